"""The ``cardbox`` command: one module per subcommand, and shared modules.

What a user can correct is a :class:`.CardboxError`, whose text ``main`` prints.
"""
