"""Depth and points as arrays of NumPy."""
