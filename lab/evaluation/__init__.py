"""Accuracy of the tracker: error measures, ground truth, recorded sessions."""
