"""What all nodes run on: executor, parameters, QoS, diagnostics, processes."""
