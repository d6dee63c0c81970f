"""Statistics of one recording file and its index entry.

The file is counted while it is written or read. `recording_index` stores the entries.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from scaraspec.judge.verdicts import Finding
from scaraspec.protocol.direction import A2C
from scaraspec.traffic.events import Exchange
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks.byte_accounting import STREAM, ByteAccounting
from scaraspec_recorder.sinks.decoder import Item
from scaraspec_recorder.sinks.file_names import is_recording_name

RERUN_SUFFIX: Final = ".rrd"
"""Suffix of the Rerun file; its stem is that of the MCAP file."""

_MOST_STREAMS: Final = 2000
"""Maximum number of streams in an index entry; the MCAP file contains all."""

_SHA256: Final = "sha256_recorded"

Stream = Mapping[str, int | str]


@dataclass(frozen=True, slots=True)
class RecordingSummary:
    """Index entry of a complete recording.

    Attributes:
        name: Name of the MCAP file.
        files: Names of the MCAP file and the .rrd file.
        size_bytes: Total size of the files.
        begin_ns: Time of the first event; without events, the file's modification time.
        end_ns: Time of the last event.
        connections: Number of connections, including those that started earlier.
        exchanges: Number of exchanges that ended in this file.
        a2c_bytes: Recorded bytes of clients.
        c2a_bytes: Recorded bytes of controllers.
        gaps: Number of gaps.
        lost_bytes: Missing bytes, without gaps of unknown length.
        findings: Number of findings by verdict; passes are not counted.
        streams: Account of each stream with the SHA-256 of its recorded bytes.
        streams_left_out: Number of streams that are not listed.
        notes: What was or may have been lost, if the file was repaired.
        first_mark_ns: Time of the first mark of a trigger; 0 for none.
        last_mark_ns: Time of the last one.
    """

    name: str
    files: tuple[str, ...]
    size_bytes: int
    begin_ns: int
    end_ns: int
    connections: int = 0
    exchanges: int = 0
    a2c_bytes: int = 0
    c2a_bytes: int = 0
    gaps: int = 0
    lost_bytes: int = 0
    findings: Mapping[str, int] = field(default_factory=dict)
    streams: Mapping[str, Stream] = field(default_factory=dict)
    streams_left_out: int = 0
    notes: tuple[str, ...] = ()
    first_mark_ns: int = 0
    last_mark_ns: int = 0

    @classmethod
    def read(cls, line: Mapping[str, Any]) -> "RecordingSummary":
        """Return the entry of an index line.

        Raises:
            ValueError: The line is not an entry, or names foreign files.
        """
        try:
            files, notes = tuple(line["files"]), tuple(line["notes"])
            entry = cls(**{**line, "files": files, "notes": notes})
            ours = is_recording_name(entry.name)
            others = set(files) - {entry.name, Path(entry.name).with_suffix(RERUN_SUFFIX).name}
        except (KeyError, TypeError) as error:
            raise ValueError(f"no entry: {error}") from None
        numbers = (
            *(entry.size_bytes, entry.begin_ns, entry.end_ns),
            *(entry.first_mark_ns, entry.last_mark_ns),
        )
        if not all(isinstance(number, int) for number in numbers):
            raise ValueError("no entry: sizes and times are whole numbers")
        if others or not ours:
            raise ValueError("no entry: it names files of others")
        return entry


class RecordingStats:
    """Counts the content of a file while it is written or read."""

    def __init__(self) -> None:
        self.begin_ns = self.end_ns = 0
        self.first_mark_ns = self.last_mark_ns = 0
        self.exchanges = 0
        self.findings: Counter[str] = Counter()
        self._connections = 0
        self._byte_accounting = ByteAccounting()
        self._recorded: Counter[str] = Counter()
        self._gaps = self._lost_bytes = 0
        self._streams: dict[str, Stream] = {}
        self._unlisted_streams = 0

    def add_event(self, event: WireEvent) -> None:
        """Count an event."""
        self.begin_ns = self.begin_ns or event.time_ns
        self.end_ns = max(self.end_ns, event.time_ns)
        if closed := self._byte_accounting.add(event):
            self._list(closed)

    def add_item(self, item: Item) -> None:
        """Count an item derived from an event."""
        if isinstance(item, Exchange):
            self.exchanges += 1
        elif isinstance(item, Finding):
            self.findings[item.verdict.value] += 1

    def add_mark(self, time_ns: int) -> None:
        """Count a mark of a trigger."""
        self.first_mark_ns = self.first_mark_ns or time_ns
        self.last_mark_ns = time_ns

    @property
    def summary_text(self) -> dict[str, str]:
        """Counts of the file, as text."""
        found = {f"findings {verdict}": str(count) for verdict, count in self.findings.items()}
        return {"exchanges": str(self.exchanges), **found}

    def build_summary(
        self, paths: tuple[Path, ...], notes: tuple[str, ...] = ()
    ) -> RecordingSummary:
        """Return the index entry of a closed file.

        Args:
            paths: The MCAP file, then the .rrd file if any.
            notes: Notes about lost data.

        Raises:
            OSError: A file does not exist.
        """
        self._list(self._byte_accounting.close())
        a2c_bytes = self._recorded[A2C.value]
        if not self.begin_ns:
            self.begin_ns = self.end_ns = paths[0].stat().st_mtime_ns
        return RecordingSummary(
            name=paths[0].name,
            files=tuple(path.name for path in paths),
            size_bytes=sum(path.stat().st_size for path in paths),
            begin_ns=self.begin_ns,
            end_ns=self.end_ns,
            connections=self._connections,
            exchanges=self.exchanges,
            a2c_bytes=a2c_bytes,
            c2a_bytes=self._recorded.total() - a2c_bytes,
            gaps=self._gaps,
            lost_bytes=self._lost_bytes,
            findings=dict(self.findings),
            streams=self._streams,
            streams_left_out=self._unlisted_streams,
            notes=notes,
            first_mark_ns=self.first_mark_ns,
            last_mark_ns=self.last_mark_ns,
        )

    def _list(self, accounts: Mapping[str, Mapping[str, str]]) -> None:
        """Add the accounts of ended streams."""
        self._connections += len({name.rpartition("/")[0] for name in accounts})
        for name, account in accounts.items():
            self._recorded[name.rpartition("/")[2]] += int(account["recorded_bytes"])
            self._gaps += int(account["gaps"])
            self._lost_bytes += int(account["lost_bytes"])
            if len(self._streams) < _MOST_STREAMS:
                self._streams[name.removeprefix(f"{STREAM}/")] = {
                    key: text if key == _SHA256 else int(text) for key, text in account.items()
                }
            else:
                self._unlisted_streams += 1
