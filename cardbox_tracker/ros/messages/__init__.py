"""Conversions between messages and the arrays of the core."""
