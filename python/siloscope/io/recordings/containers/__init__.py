"""Containers of recordings, one module each."""
