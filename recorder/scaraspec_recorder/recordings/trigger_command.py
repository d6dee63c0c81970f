"""The command of the user that runs when a trigger fires.

It never delays the recording: a thread runs one command at a time, each for a limited time, and
drops those beyond a limit. The command gets facts about the trigger as environment variables. It is
not run by a shell, so text from the link cannot become a part of the command.
"""

import logging
import os
import shutil
import subprocess
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from queue import Full, Queue
from typing import Final

from scaraspec.operating_system import split_command
from scaraspec.user_message import UserMessage
from scaraspec_recorder.sinks.file_names import utc_time

TIMEOUT_S: Final = 10.0
"""Time limit of a command; it is killed then. Also the time limit for the rest at the end."""

INTERVAL_S: Final = 1.0
"""Minimum time between the end of a command and the next start."""

MOST_WAITING: Final = 16
"""Maximum number of commands that wait; others are not run."""

_log = logging.getLogger(__name__)


def parse_command(text: str) -> tuple[str, ...]:
    """Return the words of a command line.

    Raises:
        ValueError: It is not a command line, or its program does not exist.
    """
    words = tuple(split_command(text))
    if not words or not shutil.which(words[0]):
        raise ValueError(UserMessage("{text!r}: there is no such program", text=text))
    return words


class TriggerCommand:
    """Runs a command each time a trigger fires.

    Args:
        words: The command.
        robot: Name of the robot; passed as SCARASPEC_ROBOT.
        current_file: Returns the capture file that contains the mark; passed as SCARASPEC_FILE.
        interval_s: Minimum time between two commands.
    """

    def __init__(
        self,
        words: Sequence[str],
        robot: str,
        current_file: Callable[[], Path],
        interval_s: float = INTERVAL_S,
    ) -> None:
        self._words = words
        self._robot = robot
        self._current_file = current_file
        self._interval_s = interval_s
        self._waiting: Queue[dict[str, str] | None] = Queue(MOST_WAITING)
        self._dropped = 0
        self._closing = threading.Event()
        self._worker = threading.Thread(target=self._work, daemon=True)
        self._worker.start()

    def run(self, trigger: str, reason: str, time_ns: int) -> None:
        """Run the command soon. The mark is already in the recording."""
        facts = {
            "SCARASPEC_ROBOT": self._robot,
            "SCARASPEC_TRIGGER": trigger,
            "SCARASPEC_REASON": reason.replace("\0", ""),
            "SCARASPEC_TIME": f"{utc_time(time_ns):%Y-%m-%dT%H:%M:%SZ}",
            "SCARASPEC_FILE": str(self._current_file()),
        }
        try:
            self._waiting.put_nowait(facts)
        except Full:
            self._dropped += 1
            return
        if self._dropped:
            _log.warning("the command of a trigger was not run %d times", self._dropped)
            self._dropped = 0

    def close(self) -> None:
        """Run the commands that wait, for `TIMEOUT_S` at most."""
        self._closing.set()
        try:
            self._waiting.put(None, timeout=TIMEOUT_S)
        except Full:
            return
        self._worker.join(TIMEOUT_S)

    def _work(self) -> None:
        while facts := self._waiting.get():
            self._execute(facts)
            self._closing.wait(self._interval_s)

    def _execute(self, facts: dict[str, str]) -> None:
        try:
            subprocess.run(  # noqa: S603 - the command of the user, without a shell
                self._words,
                env={**os.environ, **facts},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                timeout=TIMEOUT_S,
                check=True,
            )
        except (OSError, ValueError, subprocess.SubprocessError) as error:
            _log.warning(
                "the command of the trigger %s failed: %s", facts["SCARASPEC_TRIGGER"], error
            )
