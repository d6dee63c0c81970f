"""Bench: user programs are put on the subject, started, watched and stopped.

Whatever happens on it, afterwards no program runs and the outputs are as they were. What a program
should do is known to the cases and to `program_model`.
"""

import math
from collections.abc import Container, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from types import MappingProxyType
from typing import Final

from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.program_files import Layout, Node, Program, Variable, listing, parse
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import upload
from scaraspec.suite.controller.harness.requests.motion import (
    is_responsive,
    require_known_responsive,
    stop_motion,
)
from scaraspec.suite.controller.harness.requests.ports import (
    Bits,
    digits,
    outputs,
    outputs_preserved,
)
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    NoReply,
    expect,
    expect_equal,
)
from scaraspec.suite.program_files.layout import configured, find_layout
from scaraspec.suite.program_files.model import Block, State, nodes_of, variables_of
from scaraspec.suite.program_files.writing import program_file, wait
from scaraspec.user_message import UserMessage

PROGRAMS: Final = (Hazard.STATE, Hazard.MOTION)
"""What a case with programs may do: it stores them and runs them."""

EARLY_S: Final = 0.01
"""What two clocks may differ in over a few seconds."""

_POLL_S: Final = 0.05
_RUNS_S: Final = 5
_SETTINGS: Final = ("tool ", "port ")  # how lines of a listing begin that are about no step of it
_MOST_LETTERS: Final = 1200
_NS: Final = 1e9


class ProgramRefused(CaseFailed):
    """A valid program is not run."""


class Bench:
    """A place to run programs at; made by `bench`.

    Attributes:
        layout: Of the files that are made.
        before: The outputs as they were at first.
        started_s: When the latest program was asked for, in seconds since the Unix epoch.
        replied_s: When it was granted.
    """

    def __init__(
        self,
        subject: ControllerUnderTest,
        line: OutgoingConnection,
        layout: Layout,
        base: Program,
        before: Bits,
    ) -> None:
        self.before = before
        self.started_s = self.replied_s = 0.0
        self._stored = self._content = b""
        self.layout = layout
        self._subject, self._line, self._base = subject, line, base

    # ------------------------------------------------------------------ running

    def file(self, nodes: Iterable[Node], variables: Iterable[Variable] = ()) -> bytes:
        """A program in the subject's layout."""
        return program_file(
            self._subject.dialect, nodes, variables, layout=self.layout, base=self._base
        )

    def store(self, content: bytes) -> bytes:
        """Upload a file in place of the one before, under its name; its name.

        Nothing of the one before may be left; there may be room for few, too (A-5-21).
        """
        self._content = content
        if not self._stored or not self._line.ask("delete_program", self._stored).accepted:
            self._stored = self._subject.new_name()
        upload(self._line, self._stored, content)
        return self._stored

    def ask(self, name: bytes, command: str = "run_program") -> ReceivedFrame:
        """Ask for the run of a stored program, or for its simulation."""
        self._subject.moved = True
        self.started_s = self._subject.now_ns / _NS
        answer = self._line.ask(command, name)
        self.replied_s = answer.time_s
        return answer

    def accepts(self, content: bytes) -> bool:
        """Store a file and ask for its run; whether that is granted."""
        return self.ask(self.store(content)).accepted is True

    def start(self, nodes: Iterable[Node], variables: Iterable[Variable] = ()) -> bytes:
        """Begin a program; its name.

        Raises:
            CaseFailed: It is refused.
        """
        name = self.store(self.file(nodes, variables))
        self.restart(name)
        return name

    def restart(self, name: bytes) -> None:
        """Begin a stored program.

        Raises:
            ProgramRefused: It is refused.
        """
        answer = self.ask(name)
        if not answer.accepted:
            message = "a valid program is refused"
            raise ProgramRefused(message, expected="1", observed=f"{answer}")

    def finish(self, *, lasts_s: float = 0.0) -> ReceivedFrame:
        """Wait for the good end of a program that lasts so many seconds by its waits.

        Raises:
            CaseFailed: It fails, or does not end.
        """
        within_s = self._subject.longest_s + self.ours_s(lasts_s)
        try:
            result = self._line.result("run_program", within_s=within_s)
        except NoReply as error:
            raise CaseFailed(
                "a valid program does not end", expected="11", observed=error.observed
            ) from None
        expect(result.done, "a valid program fails", expected="11", observed=f"{result}")
        return result

    def run(
        self, nodes: Iterable[Node], variables: Iterable[Variable] = (), *, lasts_s: float = 0.0
    ) -> ReceivedFrame:
        """Run a program to its good end.

        Raises:
            CaseFailed: It is refused, fails, or does not end.
        """
        with self._told():
            self.start(nodes, variables)
            return self.finish(lasts_s=lasts_s)

    def performs(
        self,
        block: Block,
        variables: Mapping[int, int] = MappingProxyType({}),
        *,
        inputs: Bits = (),
        large: bool = False,
    ) -> None:
        """Run a program, and compare the outputs with what its statements should make of them.

        Args:
            block: Its statements.
            variables: The variables by key.
            inputs: The digital inputs, where it reads any.
            large: It may be refused for its size, which nothing bounds (A-5-21).

        Raises:
            CaseFailed: It does not run to its good end, or the outputs are others.
        """
        initial = outputs(self._line)
        state = State(initial, inputs, dict(variables))
        state.execute(block)
        nodes, records = nodes_of(block, initial), variables_of(variables)
        try:
            self.run(nodes, records, lasts_s=state.waited_s)
        except ProgramRefused:
            if not large:
                raise
            told = UserMessage(
                "a program of {nodes_count} nodes and {records_count} variables is refused",
                nodes_count=len(nodes),
                records_count=len(records),
            )
            self._subject.tolerate("6.5/26", "A-5-21", "limit", told)
            return
        message = "the outputs after a program are not those that its statements make"
        with self._told():
            self.has_left(state.outputs, state.written, message)

    def has_left(
        self, due: Bits, written: Container[int], message: str, *, shown: Bits | None = None
    ) -> None:
        """Fail the subject unless the outputs are those that a program makes of them.

        Where it configures the ports as it begins, what it does not set may be off (A-4.32-3).

        Args:
            due: The outputs.
            written: Those that it has set.
            message: What is wrong with others.
            shown: What they are; by default what they are now.

        Raises:
            CaseFailed: They are others.
        """
        shown = outputs(self._line) if shown is None else shown
        if shown != due and shown == tuple(on and n in written for n, on in enumerate(due, 1)):
            told = "a program switches off the outputs that it does not set"
            self._subject.tolerate("4.32/6", "A-4.32-3", "off", told)
        else:
            expect_equal(digits(shown), digits(due), message)

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Add a listing of the program to a failure, because its bytes are not readable."""
        try:
            yield
        except CaseFailed as error:
            lines = listing(parse(self._content)).splitlines()
            told = (" ".join(line.split()) for line in lines if not line.startswith(_SETTINGS))
            error.observed = f"{error.observed} of this program: {'; '.join(told)}"[:_MOST_LETTERS]
            raise

    def ours_s(self, seconds: float) -> float:
        """How long so many seconds of the subject are for us."""
        return seconds / self._subject.ics.time_scale

    def theirs_s(self, seconds: float) -> int:
        """How many whole seconds of the subject last for at least so many of ours."""
        return math.ceil(seconds * max(1.0, self._subject.ics.time_scale))

    # ------------------------------------------------------------------ watching

    @property
    def is_responsive(self) -> bool:
        """Whether queries are answered while a program runs (A-4-3); asked while one does."""
        return is_responsive(self._subject, self._line)

    def since_s(self) -> float:
        """How long ago the latest program was asked for, in our seconds."""
        return self._subject.now_ns / _NS - self.started_s

    def ended(self, command: str = "run_program", *, within_s: float = 0.0) -> ReceivedFrame | None:
        """The final result, if it is there by then."""
        try:
            return self._line.result(command, within_s=within_s)
        except NoReply:
            return None

    def until(self, port: int, *, on: bool, within_s: float) -> bool:
        """Wait until an output shows a state; whether it does in so many seconds of the subject.

        Raises:
            CaseSkipped: It shows nothing while it executes (A-4-3).
        """
        require_known_responsive(self._subject, self._line)
        left_s = self.ours_s(within_s)
        while outputs(self._line)[port - 1] != on:
            if left_s <= 0:
                return False
            self._line.wait(_POLL_S)
            left_s -= _POLL_S
        return True

    def stop(self) -> None:
        """End whatever runs."""
        stop_motion(self._subject, self._line)
        while self.ended() is not None:
            pass


@contextmanager
def bench(subject: ControllerUnderTest, line: OutgoingConnection) -> Iterator[Bench]:
    """A bench in the subject's layout.

    Raises:
        CaseFailed: The subject runs no programs.
        CaseInconclusive: It cannot now.
    """
    layout, base = find_layout(subject, line), configured(subject, line)
    with outputs_preserved(line) as before:
        made = Bench(subject, line, layout, base, before)
        try:
            yield made
        finally:
            with suppress(
                CaseFailed, CaseInconclusive
            ):  # the case runner reports a program that cannot be stopped
                made.stop()


@contextmanager
def running(subject: ControllerUnderTest, line: OutgoingConnection) -> Iterator[Bench]:
    """A bench on which a program runs that waits for a few seconds and does nothing else.

    Raises:
        CaseFailed: The subject runs no programs.
        CaseInconclusive: It cannot now.
        CaseSkipped: It answers nothing during execution (A-4-3).
    """
    with bench(subject, line) as robot:
        robot.start(wait(robot.theirs_s(_RUNS_S)))
        require_known_responsive(subject, line)
        yield robot
