"""Infrastructure of the nodes: parameters, QoS, diagnostics, processes."""
