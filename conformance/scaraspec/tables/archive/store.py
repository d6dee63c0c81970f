"""The files of an archive: one Parquet file for each capture and table, in partitions.

A store is a folder, or a URL that fsspec knows, such as ``s3://bucket/robots``::

    scaraspec-archive.json
    exchanges/robot=line-3/day=2026-11-26/<name>-<key>-<state>.parquet
    files/robot=line-3/day=2026-11-26/<name>-<key>-<state>.parquet

`key` identifies the capture by its URL, and `state` identifies its content, the options and the
version of scaraspec. A capture belongs to the archive if its file in `files` exists, which is
written last: a build that was killed in between is repeated, and nothing is there twice.
"""

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path, PurePosixPath
from typing import Any, Final
from urllib.parse import quote
from uuid import uuid4

from scaraspec.tables.archive.errors import ArchiveError
from scaraspec.tables.schema import SCHEMA, TABLES, FileRow
from scaraspec.user_message import UserMessage
from scaraspec_recorder.sinks.file_names import safe_name

try:
    from fsspec.core import url_to_fs  # type: ignore[import-untyped]  # it ships no types
except ImportError:
    raise ImportError("The archive needs the extra: pip install 'scaraspec[archive]'") from None

ARCHIVED: Final = tuple(name for name in TABLES if name != "frames")
"""The tables of an archive."""

NO_DAY: Final = "__HIVE_DEFAULT_PARTITION__"
"""The day of a capture without traffic: NULL in queries."""

_MARK: Final = "scaraspec-archive.json"
_PART: Final = re.compile(r".*-(?P<key>[0-9a-f]{16})-(?P<state>[0-9a-f]{16})\.parquet")
_SECOND_NS: Final = 10**9


@dataclass(frozen=True)
class Source:
    """A capture that can be archived.

    Attributes:
        url: Its path or URL.
        size_bytes: Its size.
        content: What changes with its content: the time of its last change, or its ETag.
    """

    url: str
    size_bytes: int
    content: str

    @property
    def key(self) -> str:
        """Identifies the capture in the names of parts."""
        return _digest(self.url)

    def state(self, options: Mapping[str, str]) -> str:
        """Return what identifies the content and how it is judged, for the names of parts."""
        return _digest(self.size_bytes, self.content, SCHEMA, *sorted(options.items()))


def _digest(*values: object) -> str:
    return sha256(json.dumps(values).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class PartName:
    """The name of the parts of a capture.

    Attributes:
        source: The capture.
        state: Its state, see `Source.state`.
        robot: The robot.
    """

    source: Source
    state: str
    robot: str

    def __str__(self) -> str:
        title = safe_name(PurePosixPath(self.source.url).stem) or "capture"
        return f"{title}-{self.source.key}-{self.state}"


@dataclass
class Stored:
    """What a store has of a capture.

    Attributes:
        states: The states of the capture in the table `files`.
        parts: The paths of its parts in all tables.
    """

    states: set[str] = field(default_factory=set)
    parts: list[str] = field(default_factory=list)


class Store:
    """An archive.

    Args:
        url: Its path or URL.
        create: Whether to create it if it does not exist.

    Raises:
        ArchiveError: It cannot be reached, does not exist, or is another folder with files.
    """

    def __init__(self, url: str, *, create: bool = False) -> None:
        self.url = url
        with _reaching(url):
            self.fs, self.root = url_to_fs(url)
            mark = f"{self.root}/{_MARK}"
            if not self.fs.exists(mark):
                self._create(mark, create=create)

    def _create(self, mark: str, *, create: bool) -> None:
        if not create:
            raise ArchiveError(
                UserMessage("{url} is no archive: scaraspec archive build makes one", url=self.url)
            )
        if self.fs.exists(self.root) and self.fs.find(self.root):
            raise ArchiveError(
                UserMessage(
                    "{url} has other files: name a new folder for the archive", url=self.url
                )
            )
        self.fs.makedirs(self.root, exist_ok=True)
        self.fs.pipe_file(mark, json.dumps({"schema": SCHEMA}).encode())

    def parts(self, table: str) -> list[str]:
        """Return the paths of all parts of a table."""
        folder = f"{self.root}/{table}"
        self.fs.invalidate_cache()
        found = self.fs.find(folder) if self.fs.exists(folder) else []
        return [path for path in found if _PART.fullmatch(PurePosixPath(path).name)]

    @property
    def is_local(self) -> bool:
        """Whether it is a folder of this machine."""
        return _is_local(self.fs)

    def pattern(self, table: str) -> str:
        """Return the pattern of the parts of a table, for DuckDB."""
        root = self.root if self.is_local else self.fs.unstrip_protocol(self.root)
        return f"{root}/{table}/*/*/*.parquet"

    def stored(self) -> dict[str, Stored]:
        """Return what the store has of each capture, by its key."""
        found: dict[str, Stored] = {}
        for table in ARCHIVED:
            for path in self.parts(table):
                if name := _PART.fullmatch(PurePosixPath(path).name):
                    of_capture = found.setdefault(name["key"], Stored())
                    of_capture.parts.append(path)
                    if table == "files":
                        of_capture.states.add(name["state"])
        return found

    def put(self, name: PartName, file: FileRow, folder: Path, earlier: Sequence[str] = ()) -> None:
        """Store the tables of a capture, and remove its earlier parts.

        Args:
            name: The name of the parts.
            file: The row of the capture in the table `files`.
            folder: The folder with one Parquet file for each table.
            earlier: The parts of the capture that were in the store before.

        Raises:
            ArchiveError: The store cannot be written.
        """
        partition = f"robot={quote(name.robot, safe='')}/day={_day(file.begun_ns)}"
        paths = {
            table: f"{self.root}/{table}/{partition}/{name}.parquet"
            for table in (*(each for each in ARCHIVED if each != "files"), "files")
        }
        obsolete = set(earlier) - {*paths.values()}
        with _reaching(self.url):
            for table, path in paths.items():
                if table == "files":
                    files = f"{self.root}/files/"
                    self._remove(each for each in obsolete if each.startswith(files))
                self._copy(folder / f"{table}.parquet", path)
            self._remove(obsolete)

    def _copy(self, file: Path, path: str) -> None:
        """Copy a file into the store: no reader sees a part of it."""
        self.fs.makedirs(path.rpartition("/")[0], exist_ok=True)
        if self.is_local:
            hidden = f"{path}.{uuid4().hex}.new"
            self.fs.put_file(f"{file}", hidden)
            self.fs.mv(hidden, path)
        else:
            self.fs.put_file(f"{file}", path)

    def _remove(self, paths: Iterable[str]) -> None:
        for path in paths:
            if self.fs.exists(path):
                self.fs.rm_file(path)


def _is_local(fs: Any) -> bool:
    return "file" in (fs.protocol if isinstance(fs.protocol, tuple) else (fs.protocol,))


def _day(begun_ns: int | None) -> str:
    if begun_ns is None:
        return NO_DAY
    try:
        return f"{datetime.fromtimestamp(begun_ns // _SECOND_NS, UTC):%Y-%m-%d}"
    except (OverflowError, ValueError, OSError):
        return NO_DAY


def find_sources(urls: Sequence[str], is_capture: Callable[[str], bool]) -> Iterator[Source]:
    """Yield the captures in files, folders and patterns, each once.

    Args:
        urls: Paths or URLs.
        is_capture: Whether the name of a file in a folder is that of a capture.

    Raises:
        ArchiveError: One of them does not exist, has no capture, or cannot be reached.
    """
    seen: set[str] = set()
    for url in urls:
        with _reaching(url):
            fs, path = url_to_fs(url)
            if fs.isdir(path):
                files = fs.find(path, detail=True).items()
                found = {file: info for file, info in files if is_capture(file)}
            else:
                found = {p: fs.info(p) for p in fs.glob(path)}
        if not found:
            raise ArchiveError(UserMessage("{url} has no capture", url=url))
        for path, info in sorted(found.items()):
            full = path if _is_local(fs) else fs.unstrip_protocol(path)
            if full not in seen:
                seen.add(full)
                changed = info.get("ETag") or info.get("mtime") or info.get("LastModified")
                yield Source(full, int(info["size"] or 0), f"{changed}")


def download(source: Source, folder: str) -> str:
    """Return the path of a capture on this machine; copy it into the folder if it is elsewhere.

    Raises:
        ArchiveError: It cannot be read.
    """
    with _reaching(source.url):
        fs, path = url_to_fs(source.url)
        if _is_local(fs):
            return f"{path}"
        copy = f"{folder}/{PurePosixPath(path).name}"
        fs.get_file(path, copy)
    return copy


@contextmanager
def _reaching(url: str) -> Iterator[None]:
    """Report any exception of the library that reaches a store or source as an `ArchiveError`."""
    try:
        yield
    except ArchiveError:
        raise
    except Exception as error:  # noqa: BLE001 - the libraries of fsspec have exceptions of their own
        reason = getattr(error, "strerror", None) or f"{error}" or type(error).__name__
        raise ArchiveError(
            UserMessage("{url} cannot be used: {reason}", url=url, reason=reason)
        ) from None
