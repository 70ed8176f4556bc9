"""Depth images, one module a format."""
