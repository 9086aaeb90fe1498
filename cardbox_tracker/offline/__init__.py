"""The ``cardbox`` commands that work on recordings, without a running graph."""
