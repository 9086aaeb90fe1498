"""Speed of the core, its steps and the nodes over DDS, measured from a checkout."""
