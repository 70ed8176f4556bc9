"""Parquet tables as bytes that depend on their rows alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from siloscope.fleet.extras import arrow, parquet

WRITER = {
    "compression": "zstd",
    "compression_level": 3,
    "version": "2.6",
    "data_page_version": "1.0",
    "data_page_size": 1 << 20,
    "write_statistics": True,
    "store_schema": True,
}
"""Every setting that the bytes depend on beside pyarrow's version, which each file names in ``created_by``."""

ROW_GROUP = 1 << 17
"""Rows a row group."""


def schema_of(columns: Sequence[tuple[str, str]], said: dict[str, str]) -> Any:
    """The Arrow schema of columns, (name, type) each; `said` becomes the file's own description."""
    pa = arrow()
    kinds = {"time": pa.timestamp("us", tz="UTC"), "words": pa.list_(pa.string())}
    return pa.schema([(name, kinds.get(kind) or getattr(pa, kind)()) for name, kind in columns], metadata=said)


def table_bytes(rows: Sequence[dict[str, Any]], schema: Any) -> bytes:
    """The Parquet file of rows."""
    return file_bytes(arrow().Table.from_pylist(list(rows), schema=schema))


def file_bytes(table: Any) -> bytes:
    """The Parquet file of a table."""
    sink = arrow().BufferOutputStream()
    parquet().write_table(table, sink, row_group_size=ROW_GROUP, **WRITER)
    return bytes(sink.getvalue())


def read(data: bytes, columns: Sequence[str] | None = None) -> Any:
    """The table of a Parquet file's bytes."""
    file = parquet().ParquetFile(arrow().BufferReader(data), pre_buffer=False)
    return file.read(None if columns is None else list(columns), use_threads=False)
