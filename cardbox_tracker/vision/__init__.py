"""What the camera sees: camera, encodings, background model, silhouette, rasterisation.

A silhouette is an array (height, width) of uint8, 0 for background and 255 for the person.
"""
