"""Queries of an archive in SQL (DuckDB), with views that answer the usual questions."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import PurePosixPath
from typing import Any, Final

from scaraspec.tables.archive.errors import ArchiveError
from scaraspec.tables.archive.store import ARCHIVED, Store
from scaraspec.tables.schema import columns
from scaraspec.user_message import UserMessage

try:
    import duckdb
except ImportError:
    raise ImportError("The archive needs the extra: pip install 'scaraspec[archive]'") from None

VIEWS: Final = {
    "verdicts": """
        SELECT robot, day, verdict, count(*) AS files, sum(coalesce(failures, 0)) AS failures
        FROM files LEFT JOIN (
            SELECT file, count(*) AS failures FROM findings WHERE verdict = 'fail' GROUP BY file
        ) USING (file)
        GROUP BY ALL ORDER BY ALL""",
    "requirements": """
        SELECT requirement, side, verdict, any_value(message) AS message, count(*) AS findings,
            count(DISTINCT robot) AS robots, min(time) AS first, max(time) AS last
        FROM findings GROUP BY requirement, side, verdict
        ORDER BY findings DESC, requirement, side, verdict""",
    "latency": """
        SELECT robot, day, command, count(latency_s) AS exchanges,
            1000 * quantile_cont(latency_s, 0.5) AS p50_ms,
            1000 * quantile_cont(latency_s, 0.95) AS p95_ms,
            1000 * quantile_cont(latency_s, 0.99) AS p99_ms, 1000 * max(latency_s) AS max_ms
        FROM exchanges WHERE certain AND latency_s IS NOT NULL GROUP BY ALL ORDER BY ALL""",
    "firmware": """
        SELECT robot, reply AS version, min(time) AS first, max(time) AS last
        FROM exchanges WHERE command = 'get_version' AND reply IS NOT NULL
        GROUP BY ALL ORDER BY robot, first""",
    "readings": """
        SELECT robot, reading, side, count(*) AS findings, min(time) AS first, max(time) AS last
        FROM findings WHERE reading IS NOT NULL GROUP BY ALL ORDER BY ALL""",
    "lost": """
        SELECT robot, day, count(*) AS losses, sum(length_bytes) AS bytes
        FROM losses GROUP BY ALL ORDER BY ALL""",
}
"""The views besides the tables, with their queries."""


@contextmanager
def opened(store: Store, sql: str) -> Iterator[Any]:
    """Open an archive; yield a `duckdb` connection with the tables and views in a query.

    Each table costs a look into each of its files, so that those that the query does not name are
    left out.

    Raises:
        ArchiveError: The archive has no capture yet.
    """
    archived = [PurePosixPath(path).name for path in store.parts("files")]
    if not archived:
        raise ArchiveError(UserMessage("{url} has no capture yet", url=store.url))
    words = set(re.findall(r"\w+", sql.lower()))
    views = [name for name in VIEWS if name in words]
    words.update(*(re.findall(r"\w+", VIEWS[name]) for name in views))
    tables = [name for name in ARCHIVED if name in words]
    with duckdb.connect() as connection:
        if not store.is_local:
            connection.register_filesystem(store.fs)
        connection.execute("CREATE TABLE archived AS SELECT unnest(?) AS name", [archived])
        for table in tables:
            connection.execute(_table_view(store, table))
        for name in views:
            connection.execute(f"CREATE VIEW {name} AS {VIEWS[name]}")
        yield connection


def _table_view(store: Store, table: str) -> str:
    """Return the view of a table, without captures that a killed build has not finished.

    Times become UTC times without a time zone: DuckDB's own functions for time zones need an
    extension that it downloads.
    """
    pattern = store.pattern(table).replace("'", "''")
    times = ", ".join(
        f"make_timestamp(epoch_us({column.name}::TIMESTAMPTZ)) AS {column.name}"
        for column in columns(table)
        if column.is_time
    )
    return f"""
        CREATE VIEW {table} AS SELECT * EXCLUDE (filename) REPLACE ({times})
        FROM read_parquet('{pattern}', hive_partitioning = true, union_by_name = true,
            filename = true, hive_types = {{robot: VARCHAR, day: DATE}})
        WHERE parse_filename(filename) IN (FROM archived)"""  # noqa: S608 - quotes are doubled


def query(store: Store, sql: str) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Run a query; return the names of its columns, and its rows.

    Args:
        store: The archive.
        sql: A statement of DuckDB. It can use the tables of the archive, which have the columns
            `robot` and `day` besides those of the schema, and `VIEWS`. Times are in UTC.

    Raises:
        ArchiveError: The query is wrong, or the archive has no capture yet.
    """
    with opened(store, sql) as connection:
        try:
            result = connection.execute(sql)
            names = [column[0] for column in result.description or ()]
            return names, result.fetchall() if names else []
        except duckdb.Error as error:
            raise ArchiveError(f"{error}".partition("\n")[0]) from None
