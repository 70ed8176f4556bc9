"""Cameras that the service drives itself: a sensor at this machine, a folder, a command that writes a frame."""
