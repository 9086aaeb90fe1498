"""Measure a person from three reference silhouettes, and lead them through the postures."""
