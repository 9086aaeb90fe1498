"""Tracked postures as the streams that teleoperated robots read; no ROS."""
