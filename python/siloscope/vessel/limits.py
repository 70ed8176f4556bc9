"""Limits and deviations of lengths that people give."""

from __future__ import annotations

LONGEST = 200.0
"""Longest length of a silo, m."""


LENGTH_STD = 0.01
"""Standard deviation of a length of a datasheet, m."""
