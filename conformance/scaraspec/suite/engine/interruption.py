"""Interruption: the user ends a run between two of its steps, never within a step.

A signal may arrive between any two instructions. Within a step of a connection, received bytes
would be lost to the judge or be judged twice, and the subject would fail because of the suite.
This module does not handle signals.
"""

from types import TracebackType


class Interruption:
    """A request to end the run. As a context manager it makes its body one step.

    Attributes:
        requested: The user has requested the end of the run.
    """

    def __init__(self) -> None:
        self.requested = self._pending = False
        self._steps = 0

    def ask(self) -> None:
        """End the run now, or after the running step.

        Raises:
            KeyboardInterrupt: No step is running.
        """
        self.requested = True
        if not self._steps:
            raise KeyboardInterrupt
        self._pending = True

    def __enter__(self) -> None:
        self._steps += 1

    def __exit__(
        self,
        kind: type[BaseException] | None,
        raised: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._steps -= 1
        if self._pending and not self._steps:
            self._pending = False
            raise KeyboardInterrupt
