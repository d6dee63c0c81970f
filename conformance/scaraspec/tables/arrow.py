"""Arrow tables and Parquet files with the schema of the tables; needs the extra `tables`."""

from collections.abc import Sequence
from functools import cache
from typing import IO, Any, Final

from scaraspec.tables.schema import SCHEMA, Row, columns

try:
    import pyarrow as pa  # type: ignore[import-untyped]  # it ships no types
    from pyarrow import parquet
except ImportError:
    raise ImportError("Parquet and Arrow need the extra: pip install 'scaraspec[tables]'") from None

_TYPES: Final = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
_TIME: Final = pa.timestamp("ns", tz="UTC")


@cache
def arrow_schema(name: str) -> Any:
    """Return the Arrow schema of a table; each field has its description as metadata."""
    fields = [
        pa.field(
            column.name,
            _TIME if column.is_time else _TYPES[column.type],
            nullable=column.optional,
            metadata={"description": column.text},
        )
        for column in columns(name)
    ]
    return pa.schema(fields, metadata={"schema": SCHEMA, "table": name})


def table(name: str, rows: Sequence[Row]) -> Any:
    """Return rows as a `pyarrow.Table`."""
    arrays = [[getattr(row, column.field) for row in rows] for column in columns(name)]
    schema = arrow_schema(name)
    return pa.table(
        [pa.array(a, type=f.type) for a, f in zip(arrays, schema, strict=True)], schema=schema
    )


def parquet_writer(file: IO[bytes], name: str) -> Any:
    """Return a writer of Parquet files for a table."""
    return parquet.ParquetWriter(file, arrow_schema(name), compression="zstd")
