"""What a query gives."""

from __future__ import annotations

from typing import Any, TypeAlias

from sqlalchemy import Row

Record: TypeAlias = Row[*tuple[Any, ...]]
"""A row, whose columns are attributes."""
