"""Joins the files of one recording, which rotation has split.

A file continues another one of the same robot and folder if it begins by opening a connection that
is still open. Files between which no connection was open are not joined: the recorder may not have
run between them, and what happened then is unknown.
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Final

from scaraspec.traffic.wire import EARLIER_FILE, Kind, WireEvent
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.sinks.file_names import is_recording_name
from scaraspec_recorder.sinks.gap_filler import NOT_RECORDED, GapFiller
from scaraspec_recorder.sinks.open_connections import OpenConnections, is_reopening
from scaraspec_recorder.sources.mcap_reader import McapCapture
from scaraspec_recorder.sources.mcap_records import McapSummary

_ROBOT: Final = re.compile(r"[^_]+_(.*)")


class JoinedCapture(McapCapture):
    """The wire events of several files of one recording, in order.

    Args:
        captures: The files in the order of time; at least one.
    """

    def __init__(self, captures: Sequence[McapCapture]) -> None:
        super().__init__(captures[0].path)
        self._captures = captures

    @property
    def session(self) -> Mapping[str, str]:
        """The description of the session in the first file; see `McapCapture.session`."""
        return self._captures[0].session

    def __iter__(self) -> Iterator[WireEvent]:
        """Read the files.

        Raises:
            CaptureError: See `McapCapture`.
        """
        self.summary = summary = McapSummary(finished=True)
        connections, gap_filler = OpenConnections(), GapFiller()
        for number, capture in enumerate(self._captures):
            for event in capture:
                if connections.has(event):
                    continue
                connections.update(event)
                if number and event.note == EARLIER_FILE:  # a file is missing
                    event = replace(event, note=NOT_RECORDED)  # noqa: PLW2901 - the same event
                    summary.losses += 1
                for filled in gap_filler.fill(event):
                    summary.losses += filled is not event and filled.kind is Kind.GAP
                    yield filled
            summary.add(capture.summary, capture.path)


def recordings(files: Iterable[Path]) -> list[tuple[Path, ...]]:
    """Group files: those that continue each other are one recording.

    Args:
        files: Captures of any format.

    Returns:
        The groups; the files of a group are in the order of time.
    """
    robots: defaultdict[tuple[Path, str], list[Path]] = defaultdict(list)
    groups: list[tuple[Path, ...]] = []
    for file in files:
        found = _ROBOT.fullmatch(file.stem) if is_recording_name(file.name) else None
        if found:
            robots[file.parent, found[1]].append(file)
        else:
            groups.append((file,))
    for parts in robots.values():
        groups.extend(_joined(sorted(parts)))
    return sorted(groups)


def _joined(files: Sequence[Path]) -> Iterator[tuple[Path, ...]]:
    group: list[Path] = []
    for file in files:
        if group and not _continues(file):
            yield tuple(group)
            group = []
        group.append(file)
    yield tuple(group)


def _continues(file: Path) -> bool:
    """Return whether a recording begins with a connection that was open before."""
    try:
        first = next(islice(McapCapture(file), 1), None)
    except CaptureError:
        return False
    return bool(first and first.kind is Kind.OPENED and is_reopening(first))
