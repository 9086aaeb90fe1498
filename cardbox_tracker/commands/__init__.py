"""The ``cardbox`` command."""
