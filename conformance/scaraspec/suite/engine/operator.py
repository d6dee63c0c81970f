"""Operator: a person who operates the subject where the ICS defines no hook.

`HookRunner` runs the hooks of the ICS, or asks the operator. What the operator was asked and what
the answer was is evidence of the case. A case states with ``attended`` that an operator is precise
and quick enough for it.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Final, Protocol

from scaraspec.report.operator_request import OperatorAnswer, OperatorRequest
from scaraspec.suite.engine.expectations import CaseInconclusive, CaseSkipped, HookMissing
from scaraspec.suite.engine.hooks import REQUESTS, HookError
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import Observer
from scaraspec.suite.engine.operator_terminal import OperatorTerminal
from scaraspec.user_message import UserMessage, sentence_of

GUIDANCE: Final = (
    "Leave the reach of the robot, then press Enter. s = skip this case, q = end the run, "
    "n TEXT = note."
)
"""The instructions for the operator."""
_POLL_S: Final = 0.05


class Operator(Protocol):
    """A person, or a program, that does what the suite asks for."""

    def ask(self, request: str) -> None:
        """Show a request, in plain words."""

    def poll(self, note: Callable[[str], None]) -> OperatorAnswer | None:
        """Return the answer, or None if there is none yet; do not wait for it.

        Args:
            note: Takes a remark of the operator into the results.

        Raises:
            KeyboardInterrupt: The operator ends the run.
        """


class TerminalOperator:
    """An operator at a terminal; see `Operator`.

    Args:
        say: Shows a line to the operator.
        input_fd: The file descriptor of the operator's input.
    """

    def __init__(self, say: Callable[[str], None], input_fd: int = 0) -> None:
        self._terminal = OperatorTerminal(say, input_fd, GUIDANCE)

    def ask(self, request: str) -> None:
        """Show a request, with the instructions. What was typed before confirms nothing."""
        with suppress(CaseSkipped):
            for _ in self._terminal.lines():
                pass
        template = "now: {request}. {guidance}"
        guidance = UserMessage(GUIDANCE)
        self._terminal.show(UserMessage(template, request=request, guidance=guidance))

    def poll(self, note: Callable[[str], None]) -> OperatorAnswer | None:
        """Process the lines that the operator has typed; see `Operator.poll`."""
        try:
            for line in self._terminal.lines():
                command, _, text = line.partition(" ")
                if not line:
                    return OperatorAnswer.DONE
                if command.lower() == "n" and text:
                    note(text.strip())
                else:
                    self._terminal.explain()
        except CaseSkipped:
            return OperatorAnswer.SKIPPED
        return None


class HookRunner:
    """Operates the subject.

    Args:
        ics: The ICS, which defines the hooks.
        operator: Replaces hooks that it does not define; None without an operator.
        observer: Knows the running case, and keeps the requests as its evidence.
        now_ns: Returns the current time in nanoseconds since the Unix epoch.
        pause: Receives on all connections for a time in seconds.
    """

    def __init__(
        self,
        ics: Ics,
        operator: Operator | None,
        observer: Observer,
        now_ns: Callable[[], int],
        pause: Callable[[float], None],
    ) -> None:
        self._ics, self._operator, self._observer = ics, operator, observer
        self._now_ns, self._pause = now_ns, pause

    def asks(self, name: str) -> bool:
        """Whether the running case may ask the operator in place of this hook."""
        attended = self._operator is not None and self._observer.attempt.attended
        return attended and name in REQUESTS and name not in self._ics.hooks

    def has(self, name: str) -> bool:
        """Whether the ICS defines this hook, or the operator replaces it."""
        return name in self._ics.hooks or self.asks(name)

    def run(self, name: str, *each: Mapping[str, object]) -> None:
        """Run a hook once for each set of values. An operator gets one request for all of them.

        Raises:
            HookMissing: The ICS does not define the hook, and no operator replaces it.
            CaseInconclusive: The hook failed.
        """
        if self.asks(name):
            self.ask(name, *each)
            return
        hook = self._ics.hooks.get(name)
        if hook is None:
            raise HookMissing(name)
        try:
            for values in each:
                hook.run(**values)
        except HookError as error:
            raise CaseInconclusive(sentence_of(error)) from None

    def ask(self, name: str, *each: Mapping[str, object]) -> bool:
        """Ask the operator, and receive on all connections until the answer.

        Returns:
            False if there is no operator.

        Raises:
            HookMissing: The operator skips the case.
            KeyboardInterrupt: The operator ends the run.
        """
        if self._operator is None:
            return False
        request = UserMessage.listed(
            (UserMessage(REQUESTS[name], **_in_words(values)) for values in each), semicolons=True
        )
        begun_ns, notes = self._now_ns(), list[str]()
        self._operator.ask(request)
        while (answer := self._operator.poll(notes.append)) is None:
            self._pause(_POLL_S)
        self._pause(_POLL_S)  # receive what has arrived
        self._observer.attempt.requests.append(
            OperatorRequest(request, begun_ns, self._now_ns(), answer, tuple(notes))
        )
        if answer is OperatorAnswer.SKIPPED:
            raise HookMissing(name, message="the operator skipped the case")
        return True


def _in_words(values: Mapping[str, object]) -> dict[str, str]:
    """Return values for a sentence: ``inner_arm,wrist`` becomes ``inner arm, wrist``."""
    return {key: f"{each}".replace("_", " ").replace(",", ", ") for key, each in values.items()}
