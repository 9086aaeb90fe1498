"""Image processing: camera model, encodings, background model, silhouettes, rasterisation.

A silhouette is an array (height, width) of uint8, 0 for background and 255 for the person.
"""
