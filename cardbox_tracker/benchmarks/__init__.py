"""The speed: the core, its steps, the nodes over DDS, and MediaPipe for comparison."""
