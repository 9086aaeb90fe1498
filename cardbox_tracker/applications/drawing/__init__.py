"""Draws results for people: overlay, guidance, markers, video."""
