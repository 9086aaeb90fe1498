"""Synthetic people and cameras, and recordings of them with ground truth."""
