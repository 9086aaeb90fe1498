"""What a posture means for the body's strain: scores of the work sciences; no ROS."""
