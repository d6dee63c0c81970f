"""Interruption: a tester ends a run between two of its steps, never within one.

A signal may come between any two instructions. Within a step of a wire, what was received would be
lost to the judge, or reach it twice, and the subject would fail for our haste. Signals themselves,
and what they mean, are not met here.
"""

from types import TracebackType


class Interruption:
    """Whether a run must end; as a context manager it makes its body one step.

    Attributes:
        asked: Its end was requested.
    """

    def __init__(self) -> None:
        self.asked = self._due = False
        self._steps = 0

    def ask(self) -> None:
        """End the run now, or after the running step.

        Raises:
            KeyboardInterrupt: Now.
        """
        self.asked = True
        if not self._steps:
            raise KeyboardInterrupt
        self._due = True

    def __enter__(self) -> None:
        self._steps += 1

    def __exit__(
        self,
        kind: type[BaseException] | None,
        raised: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._steps -= 1
        if self._due and not self._steps:
            self._due = False
            raise KeyboardInterrupt
