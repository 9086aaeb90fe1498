"""Tracking of one person: observation, tracker, refiner, doubt.

:class:`~.tracker.Tracker` takes the observations of all cameras at one time and returns an
:class:`~.estimate.Estimate`: posture, keypoints, and how far they can be relied upon. Time is the
images' stamp, never the clock.
"""
