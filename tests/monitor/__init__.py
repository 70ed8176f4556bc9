"""Tests of the service, against the real server in a process of its own."""
