"""Draws results for people: overlay, guidance, video, pages."""
