"""Transfer of a person's arm movements to a robot arm, within its limits; no ROS."""
