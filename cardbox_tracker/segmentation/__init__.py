"""From an image to a silhouette: learned background, light, shadows, regions, depth limits.

A silhouette is an array (height, width) of uint8, 0 for background and 255 for the person. A scene
is learned once and follows the light; nobody who stands in it becomes background.
"""
