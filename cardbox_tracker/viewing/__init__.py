"""Shows what was found in the viewer Rerun, which is an optional library; no ROS."""
