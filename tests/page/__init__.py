"""Tests of the page, in a browser, against the real service."""
