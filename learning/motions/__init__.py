"""Motions of people: motion capture of several sources and scripted movements."""
