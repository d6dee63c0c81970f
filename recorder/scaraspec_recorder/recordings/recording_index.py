"""The index contents.jsonl: one line for each recording and each removal.

The index contains only information from the files, so it can be rebuilt. Each start rebuilds what
is missing, damaged or outdated. Otherwise lines are only appended.
"""

import json
import logging
import os
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

from mcap.records import Channel, Message

from scaraspec.operating_system import replace_file
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.recordings.marks import SOURCE
from scaraspec_recorder.recordings.recording_stats import (
    RERUN_SUFFIX,
    RecordingStats,
    RecordingSummary,
)
from scaraspec_recorder.recordings.repair import incomplete_rrd, is_full, repair
from scaraspec_recorder.sinks.file_names import INDEX_NAME, is_recording_name
from scaraspec_recorder.sinks.mcap import schemas
from scaraspec_recorder.sinks.mcap.schemas import foxglove
from scaraspec_recorder.sinks.own_files import REBUILT, is_own, temporary_file
from scaraspec_recorder.sources.mcap_reader import RawLayerReader
from scaraspec_recorder.sources.mcap_records import McapSummary, read_records

_KEPT_REMOVALS: Final = 10_000
_MAX_LINE_BYTES: Final = 1 << 24

_log = logging.getLogger(__name__)


class RecordingIndex:
    """The index of a folder. The constructor updates it from the files.

    Files of a killed recorder are repaired first, see `repair`. Nothing is written before `save`.

    Args:
        folder: The folder of the recordings; no other process may write into it.

    Raises:
        OSError: The folder or the index cannot be read.

    Attributes:
        entries: Entries of the existing files, by name. Streams are only in the file on disk.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.entries: dict[str, RecordingSummary] = {}
        self._path = folder / INDEX_NAME
        self._saved = self._path.exists()
        self._unsaved: list[dict[str, Any]] = []
        self._unrepaired: list[Path] = []
        for line in self._read_lines():
            _apply(line, self.entries)
        self._add_unlisted_files()
        self._remove_missing_files()

    def repair(self) -> None:
        """Repair files for which there was too little disk space before.

        Files for which there is still too little space remain unchanged until the next call.

        Raises:
            OSError: The disk is full: recording is not possible, either.
        """
        for path in self._unrepaired:
            try:
                self._repair_and_add(path)
            except OSError as error:
                if is_full(self.folder):
                    raise
                _log.warning("%s is not repaired yet: %s", path, error)

    def save(self) -> None:
        """Rewrite the index if necessary. Must be called before further entries are added.

        Raises:
            OSError: The index cannot be written; the old one remains.
        """
        if self._saved:
            return
        removals = (line for line in self._read_lines() if "removed" in line)
        beside = temporary_file(self._path, REBUILT)
        try:
            with beside.open("wb") as file:
                file.writelines(map(_encode, deque(removals, _KEPT_REMOVALS)))
                entries = (line for line in self._read_lines() if line.get("name") in self.entries)
                file.writelines(map(_encode, entries))
                file.writelines(map(_encode, self._unsaved))
                file.flush()
                os.fsync(file.fileno())
            replace_file(beside, self._path)
        finally:
            beside.unlink(missing_ok=True)
        self._unsaved.clear()
        self._saved = True

    def add(self, entry: RecordingSummary) -> None:
        """Add an entry.

        Raises:
            OSError: The index cannot be written; the next start adds the file.
        """
        self.entries[entry.name] = replace(entry, streams={})
        self._append(asdict(entry))

    def remove(self, name: str, time_ns: int, reason: str) -> None:
        """Record that a file and its .rrd file were removed.

        Raises:
            OSError: The index cannot be written; the next start records the removal.
        """
        del self.entries[name]
        self._append({"removed": name, "time_ns": time_ns, "reason": reason})

    def _append(self, line: dict[str, Any]) -> None:
        if not self._saved:
            self._unsaved.append(line)
            return
        with self._path.open("ab") as file:
            file.write(_encode(line))
            file.flush()
            os.fsync(file.fileno())

    def _read_lines(self) -> Iterator[dict[str, Any]]:
        """Yield the valid lines of the file. An invalid line causes a rewrite."""
        for line in _lines(self._path):
            if line is None:
                self._saved = False
            else:
                yield line

    def _add_unlisted_files(self) -> None:
        for path in sorted(self.folder.glob("*.mcap")):
            if is_recording_name(path.name) and path.name not in self.entries:
                try:
                    self._repair_and_add(path)
                except OSError:
                    self._unrepaired.append(path)

    def _repair_and_add(self, path: Path) -> None:
        """Repair a file of this recorder and add it."""
        if is_own(path):
            entry = repair_and_summarize(path)
            for note in entry.notes:
                _log.warning("%s: %s", path, note)
            self._saved = False
            self.add(entry)

    def _remove_missing_files(self) -> None:
        for entry in list(self.entries.values()):
            path = self.folder / entry.name
            if path.is_symlink() or not path.exists():
                self._saved = False
                self.remove(entry.name, entry.end_ns, "it was not there any more")


def listed_recordings(folder: Path) -> dict[str, RecordingSummary]:
    """Return the entries in the index of a folder, by name; another process may append to it.

    Raises:
        OSError: The index cannot be read.
    """
    entries: dict[str, RecordingSummary] = {}
    for line in filter(None, _lines(folder / INDEX_NAME)):
        _apply(line, entries)
    return entries


def _apply(line: Mapping[str, Any], entries: dict[str, RecordingSummary]) -> None:
    if "removed" in line:
        entries.pop(line["removed"], None)
    else:
        entry = RecordingSummary.read({**line, "streams": {}})
        entries[entry.name] = entry


def _lines(path: Path) -> Iterator[dict[str, Any] | None]:
    """Yield the lines of an index; None for an invalid line."""
    try:
        file = path.open("rb")
    except FileNotFoundError:
        return
    with file:
        while text := file.readline(_MAX_LINE_BYTES):
            try:
                yield _decode(text)
            except (ValueError, RecursionError):
                yield None


def repair_and_summarize(path: Path) -> RecordingSummary:
    """Repair a recording if necessary, and count its content.

    An unreadable file gets an entry with a note.

    Raises:
        OSError: The repaired file cannot be written.
    """
    stats = RecordingStats()
    notes: tuple[str, ...] = ()
    try:
        notes = repair(path).notes
        _count(path, stats)
    except CaptureError as error:
        notes = (str(error),)
    drawn = path.with_suffix(RERUN_SUFFIX)
    if torn := incomplete_rrd(path):
        notes = (*notes, torn)
    return stats.build_summary((path, drawn) if is_own(drawn) else (path,), notes)


def _count(path: Path, stats: RecordingStats) -> None:
    """Count the content of a complete file."""
    summary, topics = McapSummary(), dict[int, str]()
    raw = RawLayerReader(summary)
    for record in read_records(path, summary):
        if event := raw.take(record):
            stats.add_event(event)
        elif isinstance(record, Channel):
            topics[record.id] = record.topic
        elif isinstance(record, Message):
            topic = topics.get(record.channel_id)
            if topic == "/exchanges":
                stats.exchanges += 1
            elif topic == "/log":
                with suppress(ValueError):  # as below
                    if foxglove.read_log(record.data)[0] == SOURCE:
                        stats.add_mark(record.log_time)
            elif topic == "/findings":
                with suppress(ValueError):  # a foreign file with the name of a recording
                    found = schemas.decode(schemas.Finding, record.data)
                    stats.findings[found.verdict] += 1


def _encode(line: Mapping[str, Any]) -> bytes:
    return json.dumps(line, ensure_ascii=False).encode() + b"\n"


def _decode(text: bytes) -> dict[str, Any]:
    """Decode a line.

    Raises:
        ValueError: The line is incomplete or not an index line.
    """
    line = json.loads(text)
    if not text.endswith(b"\n") or not isinstance(line, dict):
        raise ValueError("torn")
    if not isinstance(line.get("removed"), str):
        RecordingSummary.read(line)
    return line
