"""Silences: tests several silences at the same time, each on its own connection."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.transfer import Chunk
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import (
    begin_upload,
    receive_chunks,
    try_chunk,
)
from scaraspec.suite.engine.expectations import CaseFailed
from scaraspec.suite.engine.transfer_timeouts import Silence, transfer_timeouts_of

_INSTANT_S: Final = 1e-6


Step = Callable[[OutgoingConnection, Silence], None]
"""An action on a connection after a silence."""


@dataclass(frozen=True)
class Track:
    """The actions on one connection.

    Attributes:
        begin: The first action.
        steps: The duration of each silence in seconds, and the action after it.
    """

    begin: Callable[[OutgoingConnection], None]
    steps: tuple[tuple[float, Step], ...]


class _Running:
    """A track on its connection."""

    def __init__(self, subject: ControllerUnderTest, track: Track) -> None:
        self._subject, self._steps = subject, list(track.steps)
        self._line = subject.open()
        track.begin(self._line)
        self._silence = Silence(subject)

    @property
    def due_s(self) -> float:
        """The time until the next step, in seconds."""
        return self._steps[0][0] - self._silence.elapsed_s

    def run_next_step(self) -> bool:
        """Perform the next step. Return whether another one follows."""
        _, step = self._steps.pop(0)
        step(self._line, self._silence)
        self._silence = Silence(self._subject)
        if not self._steps:
            self._line.close()
        return bool(self._steps)


def run_tracks(subject: ControllerUnderTest, tracks: list[Track], *, at_once: bool) -> None:
    """Run all tracks, one by one or as many at once as the subject serves transfers.

    They also run one by one if the wait for a missing reply would exceed the pause of another
    track, because a late chunk may be ignored (A-5-16), or if a transfer outlives its connection.
    """
    limits = transfer_timeouts_of(subject)
    in_processes = limits.late_s + subject.reply_s < 2 * limits.must_survive_s
    at_once = (
        at_once and not subject.transfers_outlive and (in_processes or _refuses_strays(subject))
    )
    waiting = list(tracks)
    while waiting:
        running = [_Running(subject, waiting.pop(0))]
        while at_once and waiting:
            try:
                running.append(_Running(subject, waiting[0]))
            except CaseFailed:  # it serves no more at once
                break
            del waiting[0]
        _run(subject, running)


def _run(subject: ControllerUnderTest, running: list[_Running]) -> None:
    """Perform the steps of these tracks at their times."""
    while running:
        first = min(running, key=lambda each: each.due_s)
        while (left_s := first.due_s) > _INSTANT_S:
            subject.pause(left_s)  # ends early if the subject closes a connection
        if not first.run_next_step():
            running.remove(first)


def uploads_at_once(subject: ControllerUnderTest) -> bool:
    """Whether two connections can upload at the same time (A-5-17)."""
    if not subject.supports_multiple_connections:
        return False
    lines = [subject.open(), subject.open()]
    try:
        for line in lines:
            begin_upload(line, subject.new_name())
        chunk = Chunk(1, 0, 1, b"!")
        taken = [try_chunk(line, chunk, within_s=line.chunk_timeout_s) for line in lines]
    except CaseFailed:
        taken = [False]
    for line in lines:
        line.close()
    return all(taken)


def downloads_at_once(subject: ControllerUnderTest, name: bytes) -> bool:
    """Whether two connections can download an existing file at the same time."""
    if not subject.supports_multiple_connections:
        return False
    lines = [subject.open(), subject.open()]
    try:
        taken = [line.ask("download_name", data=name).accepted for line in lines]
        if all(taken):
            deque(zip(*map(receive_chunks, lines), strict=True), maxlen=0)
    except (CaseFailed, ValueError):  # a chunk of the other download, or none
        taken = [False]
    for line in lines:
        line.close()
    return all(taken)


def _refuses_strays(subject: ControllerUnderTest) -> bool:
    """Whether a chunk without an upload is answered (A-5-16); False if this is not allowed."""
    if Hazard.STATE not in subject.allowed:
        return False
    line = subject.open()
    refuses = try_chunk(line, Chunk(1, 0, 1, b"!")) is not None or line.ending is not None
    line.close()
    return refuses
