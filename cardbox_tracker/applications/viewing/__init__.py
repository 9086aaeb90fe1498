"""Shows results in the viewer Rerun, an optional library, without ROS."""
