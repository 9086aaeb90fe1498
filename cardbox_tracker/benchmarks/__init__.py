"""How fast it is: the core, its stages, the nodes over DDS, MediaPipe beside them."""
