"""pyarrow, which every table of the fleet needs, imported when one is read or written."""

from __future__ import annotations

from typing import Any

from siloscope.io.extras import need


def arrow() -> Any:
    """pyarrow. Every call that could take threads is told not to: a worker has one core."""
    return need("pyarrow", "fleet", "a table of the fleet")


def parquet() -> Any:
    """pyarrow's Parquet module."""
    return need("pyarrow.parquet", "fleet", "a table of the fleet")
