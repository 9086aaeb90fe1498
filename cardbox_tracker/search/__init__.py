"""The search of the posture: resampling, the paper's hierarchy of particle filters, the whole body.

A search takes the frames of all cameras at one time and returns rated states (N, n). Its random
numbers come from the generator that it is given, so the same frames and seed give the same bytes.
"""
