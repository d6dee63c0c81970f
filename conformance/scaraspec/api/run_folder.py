"""The output folder of a certification: the recording during the run, the reports at its end."""

from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from scaraspec.api.viewer import has_viewer
from scaraspec.report import ctrf, html, junit
from scaraspec.report.model import Results
from scaraspec.traffic.wire import WireEvent
from scaraspec.user_message import UserMessage
from scaraspec_recorder.recordings.capture import capture_sink
from scaraspec_recorder.sinks.background_recorder import BackgroundRecorder
from scaraspec_recorder.sinks.sink import SinkFailed

RESULTS: Final = ("results.json", "report.html", "junit.xml", "ctrf.json")
CAPTURE: Final = "capture.mcap"


class RunFolderError(Exception):
    """The folder cannot be used, or its recording is incomplete; one sentence for the user."""


class RunFolder:
    """The output folder of a run.

    Args:
        path: The folder; None to write nothing.
        resume: Continue an earlier run in this folder instead of refusing it. The new recording
            goes into a subfolder ``sitting-2`` and so on.
        needs_login: False for a serial link (L83).

    Attributes:
        earlier: The results of the earlier run.

    Raises:
        RunFolderError: The folder contains the results of an earlier run.
        ResultsError: The results to continue cannot be read.
        OSError: The folder cannot be created.
    """

    def __init__(
        self, path: Path | None, *, resume: bool = False, needs_login: bool = True
    ) -> None:
        self._path = path
        self._recording: BackgroundRecorder | None = None
        self.earlier: Results | None = None
        if path is None:
            return
        path.mkdir(parents=True, exist_ok=True)
        existing = [name for name in RESULTS if (path / name).exists()]
        if existing and not resume:
            raise RunFolderError(
                UserMessage(
                    "{folder} contains {file} of an earlier run: name another folder",
                    folder=path,
                    file=existing[0],
                )
            )
        folder = path
        if existing:
            self.earlier = Results.read(path / RESULTS[0])
            folder = path / f"sitting-{len(list(path.glob('sitting-*'))) + 2}"
            folder.mkdir()
        sink = partial(capture_sink, draw=has_viewer(), needs_login=needs_login)
        self._recording = BackgroundRecorder(folder, [sink])

    @property
    def capture(self) -> str:
        """The recording, relative to the results; empty if there are several."""
        return CAPTURE if self._path and not self.earlier else ""

    def record(self, event: WireEvent) -> None:
        """Record an event."""
        if self._recording:
            self._recording.write(event)

    def write(self, results: Results) -> None:
        """Write all reports.

        Raises:
            OSError: A report cannot be written.
        """
        if self._path is None:
            return
        results.write(self._path / "results.json")
        html.write(results, self._path / "report.html")
        junit.write(results, self._path / "junit.xml")
        ctrf.write(results, self._path / "ctrf.json")

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the recording.

        Raises:
            RunFolderError: The recording could not be written.
        """
        if self._recording:
            try:
                self._recording.close()
            except SinkFailed as error:
                raise RunFolderError(
                    UserMessage(
                        "{folder}: the recording is incomplete: {error}",
                        folder=self._path,
                        error=error,
                    )
                ) from None
