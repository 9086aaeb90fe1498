"""Pictures and a page of a tracked recording."""
