"""The output folder of a certification: the recording during the run, the reports at its end."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

from scaraspec.api.viewer import has_viewer
from scaraspec.report import ctrf, html, junit, reproduction
from scaraspec.report.model import Results, Role
from scaraspec.suite.engine.ics import Ics
from scaraspec.traffic.wire import WireEvent
from scaraspec.user_message import UserMessage
from scaraspec_recorder.sinks.sink import SinkFailed

if TYPE_CHECKING:
    from scaraspec_recorder.sinks.background_recorder import BackgroundRecorder

RESULTS: Final = ("results.json", "report.html", "junit.xml", "ctrf.json", reproduction.FOLDER)
CAPTURE: Final = "capture.mcap"
RESERVE: Final = ".results.reserve"
_RESERVED_BYTES: Final = 4 * 2**20


class RunFolderError(Exception):
    """The folder cannot be used, or its recording is incomplete; one sentence for the user."""


class RunFolder:
    """The output folder of a run.

    Args:
        path: The folder; None to write nothing.
        role: The role of the subject.
        ics: What it claims. The recording states both, for an audit of it.
        earlier: The results of an earlier run in this folder, which this run continues. The new
            recording goes into a subfolder ``sitting-2`` and so on.
        needs_login: False for a serial link (L83).
        redact: Whether passwords are masked in the raw bytes of the recording.

    Attributes:
        path: The folder; None if nothing is written.

    Raises:
        RunFolderError: The folder contains the results of another run, or is a file.
        OSError: The folder cannot be created.
    """

    def __init__(  # noqa: PLR0913 - independent options
        self,
        path: Path | None,
        role: Role,
        ics: Ics,
        *,
        earlier: Results | None = None,
        needs_login: bool = True,
        redact: bool = False,
    ) -> None:
        self.path = path
        self._recording: BackgroundRecorder | None = None
        self._reserve: Path | None = None
        self._created: Path | None = None
        self._earlier = earlier
        if path is None:
            return
        if not path.exists():
            path.mkdir(parents=True)
            self._created = path
        if not earlier:
            require_unused(path)
        folder = path
        if earlier:
            folder = path / f"sitting-{len(list(path.glob('sitting-*'))) + 2}"
            folder.mkdir()
        self._reserve = _reserve_space(folder / RESERVE)
        self._recording = _recorder(role, ics, folder, needs_login=needs_login, redact=redact)

    @property
    def capture(self) -> str:
        """The recording, relative to the results; empty if there are several."""
        return CAPTURE if self.path and not self._earlier else ""

    def record(self, event: WireEvent) -> None:
        """Write a wire event to the recording."""
        if self._recording:
            self._recording.write(event)

    def finish(self, results: Results) -> None:
        """Close the recording and write all reports, results.json first.

        Raises:
            RunFolderError: The recording is incomplete, or a report cannot be written. Everything
                that can be written is written.
        """
        if self.path is None:
            return
        problems = [*self._close_recording()]
        if self._reserve:
            self._reserve.unlink(missing_ok=True)
        for name, write in _writers().items():
            try:
                write(results, self.path / name)
            except OSError as error:
                problems.append(
                    UserMessage(
                        "{path} cannot be written: {reason}",
                        path=self.path / name,
                        reason=error.strerror,
                    )
                )
        if problems:
            raise RunFolderError(problems[0])

    def discard(self) -> None:
        """Delete what this run has written, and the folder if this run has created it."""
        list(self._close_recording())
        for name in (*RESULTS, CAPTURE, "capture.rrd", RESERVE):
            if self._created:
                (self._created / name).unlink(missing_ok=True)
        if self._created:
            with suppress(OSError):  # it is not empty: something else has written into it
                self._created.rmdir()

    def _close_recording(self) -> Iterator[str]:
        """Close the recording once; yield a sentence if it is incomplete."""
        recording, self._recording = self._recording, None
        if recording:
            try:
                recording.close()
            except SinkFailed as error:
                yield UserMessage(
                    "{path}: the recording is incomplete: {error}", path=self.path, error=error
                )

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the recording, if the run ended without results."""
        list(self._close_recording())
        if self._reserve:
            self._reserve.unlink(missing_ok=True)


def require_unused(path: Path) -> None:
    """Require that a path is no file, and no folder with results of another run.

    Raises:
        RunFolderError: It is.
    """
    if path.exists() and not path.is_dir():
        raise RunFolderError(UserMessage("{path} is not a folder: name another one", path=path))
    if existing := _results_in(path):
        raise RunFolderError(
            UserMessage(
                "{folder} contains {file} of an earlier run: name another folder",
                folder=path,
                file=existing[0],
            )
        )


def earlier_results(path: Path | None) -> Results | None:
    """Return the results of an earlier run in this folder; None if there are none.

    Raises:
        ResultsError: There are results, but they cannot be read.
    """
    return Results.read(path / RESULTS[0]) if path and _results_in(path) else None


def write_results(results: Results, folder: Path) -> None:
    """Write results that need no recording, such as merged ones, into a folder without results.

    Raises:
        RunFolderError: The folder contains results, or is a file.
        OSError: The folder cannot be created, or a report cannot be written.
    """
    require_unused(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, write in _writers().items():
        write(results, folder / name)


def _writers() -> Mapping[str, Callable[[Results, Path], None]]:
    """Return what writes each file of results, the most important first."""
    writers = (Results.write, html.write, junit.write, ctrf.write, reproduction.write)
    return dict(zip(RESULTS, writers, strict=True))


def _results_in(folder: Path) -> list[str]:
    return [name for name in RESULTS if (folder / name).exists()]


def _recorder(
    role: Role, ics: Ics, folder: Path, *, needs_login: bool, redact: bool
) -> "BackgroundRecorder":
    """Return a recorder of the run, which states in the recording what the subject claims."""
    from scaraspec_recorder.recordings.capture import (  # noqa: PLC0415 - imports the MCAP library
        capture_sink,
    )
    from scaraspec_recorder.sinks.background_recorder import (  # noqa: PLC0415 - asyncio
        BackgroundRecorder,
    )
    from scaraspec_recorder.sinks.mcap.mcap_sink import (  # noqa: PLC0415 - the MCAP library
        CLAIM,
        SUBJECT,
    )

    claims = {f"{CLAIM}{key}": value for key, value in ics.recorded.items()}
    sink = partial(
        capture_sink,
        session={SUBJECT: role.value, **claims},
        draw=has_viewer(),
        needs_login=needs_login,
        redact=redact,
    )
    return BackgroundRecorder(folder, [sink])


def _reserve_space(path: Path) -> Path | None:
    """Occupy space for results.json, so that a disk that becomes full does not lose the results.

    Returns:
        The file to delete before results.json is written; None if there is no space.
    """
    try:
        path.write_bytes(bytes(_RESERVED_BYTES))
    except OSError:
        path.unlink(missing_ok=True)
        return None
    return path
