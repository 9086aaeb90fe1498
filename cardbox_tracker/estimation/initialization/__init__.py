"""Measurement of a person from three reference silhouettes, and guidance through the postures."""
