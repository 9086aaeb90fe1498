"""The ``cardbox`` command: one module per subcommand, and shared modules."""
