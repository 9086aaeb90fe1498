"""Recorded sessions with ground truth: initialize, track, compare, report."""
