"""Fits of the prior of the arms and of the doubt, which the package ships."""
