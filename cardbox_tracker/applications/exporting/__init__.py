"""Files of a tracked motion for other programs (``docs/export.md``)."""
