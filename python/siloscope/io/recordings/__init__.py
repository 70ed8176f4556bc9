"""Recordings of depth cameras: containers, and what the vendors put into them."""
