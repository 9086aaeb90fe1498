"""Moves a robot arm as the measured person moves theirs, within its limits; no ROS."""
