"""Searches that take the place of the paper's hierarchy of filters, with as many ratings."""
