"""Scripts that make shipped files and parts of the documents; not installed."""
