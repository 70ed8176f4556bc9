"""Tests of packing and of runs over many frames."""
