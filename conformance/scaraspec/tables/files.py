"""Files of tables: CSV, JSON Lines and Parquet. No file is overwritten."""

import csv
import json
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import IO, Any, Final

from scaraspec.tables.schema import NAMES, SCHEMA, Column, Row, columns

_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
_SECOND_NS: Final = 10**9
_BATCH_ROWS: Final = 10_000
_FORMULA: Final = ("=", "+", "-", "@", "\t")


def utc_text(time_ns: int) -> str:
    """Return a time as ISO 8601 text in UTC with nanoseconds."""
    second = _EPOCH + timedelta(seconds=time_ns // _SECOND_NS)
    return f"{second:%Y-%m-%dT%H:%M:%S}.{time_ns % _SECOND_NS:09d}Z"


def json_line(row: Row) -> str:
    """Return a row as one line of JSON, with the name of its table as `table`."""
    name = NAMES[type(row)]
    values = {column.name: _plain(row, column) for column in columns(name)}
    return json.dumps({"table": name, **values}, ensure_ascii=False)


def _plain(row: Row, column: Column) -> Any:
    value = getattr(row, column.field)
    return utc_text(value) if column.is_time and value is not None else value


class _Table(ABC):
    """A file that holds one table.

    Args:
        path: The path of the file, which must not exist.
        name: The table.
    """

    file: IO[Any]

    def __init__(self, path: Path, name: str) -> None:
        self.path, self._name = path, name

    @abstractmethod
    def add(self, row: Row) -> None:
        """Add a row."""

    @abstractmethod
    def close(self) -> None:
        """Write the rest."""


class _CsvTable(_Table):
    """A CSV file in UTF-8 with a byte order mark, which spreadsheets need for other scripts.

    Text that a spreadsheet would take for a formula begins with an apostrophe.
    """

    def __init__(self, path: Path, name: str) -> None:
        super().__init__(path, name)
        self._columns = columns(name)
        self.file = path.open("x", encoding="utf-8-sig", newline="")
        self._writer = csv.writer(self.file)
        self._writer.writerow(column.name for column in self._columns)

    def add(self, row: Row) -> None:
        self._writer.writerow(_cell(row, column) for column in self._columns)

    def close(self) -> None:
        self.file.close()


def _cell(row: Row, column: Column) -> object:
    value = _plain(row, column)
    if isinstance(value, bool):
        return "true" if value else "false"
    formula = column.type is str and isinstance(value, str) and value.startswith(_FORMULA)
    return f"'{value}" if formula else value


class _ParquetTable(_Table):
    """A Parquet file, written in groups of rows. Times have the type timestamp[ns, UTC]."""

    def __init__(self, path: Path, name: str) -> None:
        from scaraspec.tables import arrow  # noqa: PLC0415 - an optional extra

        super().__init__(path, name)
        self._arrow = arrow
        self._rows: list[Row] = []
        self.file = path.open("xb")
        self._writer = arrow.parquet_writer(self.file, name)

    def add(self, row: Row) -> None:
        self._rows.append(row)
        if len(self._rows) == _BATCH_ROWS:
            self._flush()

    def close(self) -> None:
        try:
            self._flush()
            self._writer.close()
        finally:
            self.file.close()

    def _flush(self) -> None:
        self._writer.write_table(self._arrow.table(self._name, self._rows))
        self._rows.clear()


_FORMATS: Final[dict[str, type[_Table]]] = {"csv": _CsvTable, "parquet": _ParquetTable}


@contextmanager
def _names(path: Path) -> Iterator[None]:
    """Add the file to an error that names none, such as that of a full disk."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or f"{path}"
        raise


class TableFolder:
    """A folder with one file for each table.

    Args:
        folder: The folder; created if it does not exist.
        suffix: ``csv`` or ``parquet``.
        names: The tables.

    Raises:
        OSError: The folder cannot be used, or has one of the files already.
        ImportError: The format needs an extra; the message names it.
    """

    def __init__(self, folder: Path, suffix: str, names: Iterable[str]) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._tables: dict[str, _Table] = {}
        with ExitStack() as undo:
            for name in names:
                path = folder / f"{name}.{suffix}"
                self._tables[name] = _FORMATS[suffix](path, name)
                undo.callback(path.unlink)
                undo.callback(self._tables[name].close)
            undo.pop_all()

    def add(self, row: Row) -> None:
        """Add a row to its table; rows of other tables are ignored."""
        if table := self._tables.get(NAMES[type(row)]):
            with _names(table.path):
                table.add(row)

    def close(self) -> None:
        """Complete the files.

        Raises:
            OSError: A file cannot be written.
        """
        with ExitStack() as closing:
            for table in self._tables.values():
                closing.enter_context(_names(table.path))
                closing.callback(table.close)

    def discard(self) -> None:
        """Remove the files."""
        for table in self._tables.values():
            table.close()
            table.path.unlink()


@contextmanager
def table_folders(
    folders: Sequence[tuple[Path, str]], names: Sequence[str]
) -> Iterator[list[TableFolder]]:
    """Open folders of tables; the files are complete when the context ends, also after an error.

    Args:
        folders: The folders, each with the suffix of its files. If one cannot be used, no file of
            the others remains.
        names: The tables.

    Raises:
        OSError: A folder cannot be used, has one of the files already, or cannot be written.
        ImportError: A format needs an extra; the message names it.
    """
    opened: list[TableFolder] = []
    try:
        for folder, suffix in folders:
            opened.append(TableFolder(folder, suffix, names))
    except (OSError, ImportError):
        for tables in opened:
            tables.discard()
        raise
    with ExitStack() as closing:
        for tables in opened:
            closing.callback(tables.close)
        yield opened


__all__ = ["SCHEMA", "TableFolder", "json_line", "table_folders", "utc_text"]
