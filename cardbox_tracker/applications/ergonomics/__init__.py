"""Ergonomic scores of postures, without ROS."""
