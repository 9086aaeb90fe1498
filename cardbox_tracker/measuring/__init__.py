"""Measurement of a person from reference postures: sizes, colours, stature; and of cameras by them.

From the silhouettes of known postures come a body model and how well it fits. A further camera's
place, and the pitch and roll of one, follow from a person who stands or moves before it.
"""
