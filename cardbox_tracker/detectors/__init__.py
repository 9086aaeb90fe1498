"""Detectors of people: points with their certainty and a mask for each person in one image.

Points are column and row in the working image, px, with a score from 0 to 1. MediaPipe's networks
are one detector (an optional library), a table of points that another program has found is another.
"""
