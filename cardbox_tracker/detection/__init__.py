"""Person detectors: 2D points and masks of one person in a colour image, free of ROS."""
