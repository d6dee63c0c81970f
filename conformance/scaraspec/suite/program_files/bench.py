"""Bench: uploads, starts, observes and stops user programs.

At the end no program runs, and the outputs are restored. The cases and `model` know what a program
must do.
"""

import math
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from types import MappingProxyType
from typing import Final

from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.program_files import Layout, Node, Program, Variable, listing, parse
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import upload
from scaraspec.suite.controller.harness.requests.motion import (
    IDLE,
    is_responsive,
    require_known_responsive,
    status_of,
    stop_motion,
)
from scaraspec.suite.controller.harness.requests.ports import (
    Bits,
    digits,
    outputs,
    outputs_preserved,
)
from scaraspec.suite.controller.harness.timeouts import ExpectedReply
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    NoReply,
    expect,
    expect_equal,
)
from scaraspec.suite.program_files.layout import configured, find_layout
from scaraspec.suite.program_files.model import Block, State, nodes_of, variables_of
from scaraspec.suite.program_files.writing import loop, program_file, wait
from scaraspec.user_message import UserMessage

PROGRAMS: Final = (Hazard.STATE, Hazard.MOTION)
"""The hazards of a case that stores and runs programs."""

EARLY_S: Final = 0.01
"""The tolerance between two clocks over a few seconds, in seconds."""

_SIMULATE: Final = "simulate_program"
_POLL_S: Final = 0.02
_NODE_S: Final = 0.1  # how long a node may take that does not wait; the document sets no limit
_RUNS_S: Final = 5
_SETTINGS: Final = ("tool ", "port ")  # the beginning of the lines of a listing that are not steps
_MAX_CHARACTERS: Final = 1200
_NS: Final = 1e9


class ProgramRefused(CaseFailed):
    """The controller refuses to run a valid program."""


class Bench:
    """Runs programs; created by `bench`.

    Attributes:
        layout: The layout of the program files.
        before: The outputs at the start.
        started_s: When the last program was requested, in seconds since the Unix epoch.
        replied_s: When this request was answered.
        ended_s: When the final result of the last program that ended was received.
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
        self.started_s = self.replied_s = self.ended_s = 0.0
        self._stored = self._content = b""
        self.layout = layout
        self._subject, self._line, self._base = subject, line, base

    # ------------------------------------------------------------------ running

    def file(self, nodes: Iterable[Node], variables: Iterable[Variable] = ()) -> bytes:
        """Return a program file in the layout of the subject."""
        return program_file(
            self._subject.dialect, nodes, variables, layout=self.layout, base=self._base
        )

    def store(self, content: bytes) -> bytes:
        """Replace the previous file by this one, under the same name. Return the name.

        The previous file is deleted first, so that there is enough space (A-5-21).
        """
        self._content = content
        if not self._stored or not self._line.ask("delete_program", self._stored).accepted:
            self._stored = self._subject.new_name()
        upload(self._line, self._stored, content)
        return self._stored

    def ask(self, name: bytes, command: str = "run_program") -> ReceivedFrame:
        """Request to run or simulate a stored program, and return the first reply."""
        self._subject.moved = True
        self.started_s = self._subject.now_ns / _NS
        answer = self._line.ask(command, name)
        self.replied_s = answer.time_s
        return answer

    def accepts(self, content: bytes) -> bool:
        """Upload a file and request to run it. Return whether this is accepted."""
        return self.ask(self.store(content)).accepted is True

    def start(self, nodes: Iterable[Node], variables: Iterable[Variable] = ()) -> bytes:
        """Start a program, and return its name.

        Raises:
            CaseFailed: The controller refuses the program.
        """
        name = self.store(self.file(nodes, variables))
        self.restart(name)
        return name

    def restart(self, name: bytes) -> None:
        """Start a stored program.

        Raises:
            ProgramRefused: The controller refuses the program.
        """
        answer = self.ask(name)
        if not answer.accepted:
            message = "a valid program is refused"
            raise ProgramRefused(message, expected="1", observed=f"{answer}")

    def finish(self, *, lasts_s: float = 0.0) -> ReceivedFrame:
        """Wait for the successful end of a program.

        Args:
            lasts_s: How long it waits and calculates, in seconds of the subject's clock.

        Raises:
            CaseFailed: The program fails, or does not end.
        """
        within_s = self._subject.longest_s + self.ours_s(lasts_s)
        try:
            result = self._line.result("run_program", within_s=within_s)
        except NoReply as error:
            error.args, error.expected = ("a valid program does not end",), "11"
            error.preparation = bool(error.requirement)  # a known failure
            raise
        self.ended_s = result.time_s
        expect(result.done, "a valid program fails", expected="11", observed=f"{result}")
        return result

    def run(
        self, nodes: Iterable[Node], variables: Iterable[Variable] = (), *, lasts_s: float = 0.0
    ) -> ReceivedFrame:
        """Run a program to its successful end.

        Raises:
            CaseFailed: The program is refused, fails, or does not end.
        """
        with self.with_listing():
            self.start(nodes, variables)
            return self.finish(lasts_s=lasts_s)

    def performs(  # noqa: PLR0913 - each may differ
        self,
        block: Block,
        variables: Mapping[int, int] = MappingProxyType({}),
        *,
        inputs: Bits = (),
        large: bool = False,
        simulated: bool = False,
        while_running: Callable[[], None] = lambda: None,
    ) -> None:
        """Run a program, and compare the outputs with the result of its statements.

        Args:
            block: Its statements.
            variables: The variables by key.
            inputs: The digital inputs, if it reads any.
            large: The program may be refused because of its size (A-5-21).
            simulated: Simulate the program before.
            while_running: What to do while the program runs.

        Raises:
            CaseFailed: The program does not end successfully, or the outputs differ.
        """
        initial = outputs(self._line)
        state = State(initial, inputs, dict(variables))
        state.execute(block)
        nodes, records = nodes_of(block, initial), variables_of(variables)
        try:
            with self.with_listing():
                name = self.store(self.file(nodes, records))
                lasts_s = state.waited_s + _NODE_S * len(nodes)
                if simulated:
                    self._simulate(name, lasts_s)
                self.restart(name)
                while_running()
                self.finish(lasts_s=lasts_s)
        except ProgramRefused:
            if not large:
                raise
            message = UserMessage(
                "a program of {node_count} nodes and {variable_count} variables is refused",
                node_count=len(nodes),
                variable_count=len(records),
            )
            self._subject.tolerate("6.5/26", "A-5-21", "limit", message)
            return
        with self.with_listing():
            expect(
                self.ended_s - self.started_s >= self.ours_s(state.waited_s) - EARLY_S,
                "a program ends before its waits are over",
                expected=UserMessage(
                    "at least {limit_s} s", limit_s=f"{self.ours_s(state.waited_s):g}"
                ),
                observed=f"{self.ended_s - self.started_s:.2f} s",
                requirement="6.5/20",
            )
            mismatch = "the outputs after a program differ from the result of its statements"
            self.expect_outputs(state.outputs, state.written, mismatch)

    def _simulate(self, name: bytes, lasts_s: float) -> None:
        """Simulate a stored program to its end.

        Raises:
            CaseFailed: The controller refuses it, or it does not end successfully.
        """
        answer = self.ask(name, _SIMULATE)
        message = "the simulation of a valid program is refused"
        expect(answer.accepted, message, expected="1", observed=f"{answer}", requirement="4.16/2")
        result = self._line.result(_SIMULATE, within_s=self._subject.longest_s + lasts_s)
        message = "the simulation of a valid program fails"
        expect(result.done, message, expected="11", observed=f"{result}", requirement="4.16/3")

    def loop(self, body: Sequence[Node]) -> list[Node]:
        """Return a loop around `body`, in the dialect of the subject."""
        return loop(self._subject.dialect, body)

    def expect_outputs(
        self, expected: Bits, written: Container[int], message: str, *, reported: Bits | None = None
    ) -> None:
        """Require that the outputs are the result of a program.

        A robot that configures the ports at the start of a program may switch off the outputs that
        the program does not set (A-4.32-3).

        Args:
            expected: The expected outputs.
            written: The ports that the program has set.
            message: The message of the failure.
            reported: The reported outputs; by default the current ones.

        Raises:
            CaseFailed: The outputs differ.
        """
        reported = outputs(self._line) if reported is None else reported
        unset_off = tuple(on and port in written for port, on in enumerate(expected, 1))
        if reported != expected and reported == unset_off:
            warning = "a program switches off the outputs that it does not set"
            self._subject.tolerate("4.32/6", "A-4.32-3", "off", warning)
        else:
            expect_equal(digits(reported), digits(expected), message)

    @contextmanager
    def with_listing(self) -> Iterator[None]:
        """Add a listing of the program to a failure."""
        try:
            yield
        except CaseFailed as error:
            lines = listing(parse(self._content)).splitlines()
            steps = (" ".join(line.split()) for line in lines if not line.startswith(_SETTINGS))
            template, listed = "{observed} of this program: {steps}", "; ".join(steps)
            whole = UserMessage(template, observed=error.observed, steps=listed)
            kept = max(len(listed) - max(len(whole) - _MAX_CHARACTERS, 0), 0)
            error.observed = UserMessage(template, observed=error.observed, steps=listed[:kept])
            raise

    def ours_s(self, seconds: float) -> float:
        """Convert seconds of the subject's clock to seconds of our clock."""
        return seconds / self._subject.ics.time_scale

    def theirs_s(self, seconds: float) -> int:
        """Return whole seconds of the subject's clock that are not shorter than these of ours."""
        return math.ceil(seconds * max(1.0, self._subject.ics.time_scale))

    # ------------------------------------------------------------------ watching

    @property
    def is_responsive(self) -> bool:
        """Whether queries are answered while a program runs (A-4-3). Use this while one runs."""
        return is_responsive(self._subject, self._line)

    def since_s(self) -> float:
        """Return the time since the last program was requested, in seconds of our clock."""
        return self._subject.now_ns / _NS - self.started_s

    def ended(self, command: str = "run_program", *, within_s: float = 0.0) -> ReceivedFrame | None:
        """Return the final result if it arrives in time; else None."""
        try:
            return self._line.result(command, within_s=within_s)
        except NoReply:
            return None

    def is_overdue(self, deadline: Deadline, command: str = "run_program") -> bool:
        """Whether a final result that has not come is missing.

        If it was missing before and has never come, an idle status shows this before the deadline.
        """
        due, timeout_policy = ExpectedReply(command, result=True), self._subject.timeout_policy
        if deadline.expired:
            timeout_policy.note_timeout(due)
            return True
        known = timeout_policy.given_up(due) and self.is_responsive
        return known and status_of(self._subject, self._line) == IDLE

    def until(self, port: int, *, on: bool, within_s: float) -> bool:
        """Wait until an output has a state.

        Args:
            port: The output.
            on: The state.
            within_s: The timeout, in seconds of the subject's clock.

        Returns:
            Whether the output has this state in time.

        Raises:
            CaseSkipped: The robot answers no query while it executes (A-4-3).
        """
        require_known_responsive(self._subject, self._line)
        deadline = Deadline(self._subject, self.ours_s(within_s))
        while outputs(self._line)[port - 1] != on:
            if deadline.expired:
                return False
            self._line.wait(_POLL_S)
        return True

    def stop(self) -> None:
        """Stop any command that executes."""
        stop_motion(self._subject, self._line)
        while self.ended() is not None:
            pass


@contextmanager
def bench(subject: ControllerUnderTest, line: OutgoingConnection) -> Iterator[Bench]:
    """Yield a bench. Stop its program and restore the outputs when the context ends.

    Raises:
        CaseFailed: The subject runs no programs.
        CaseInconclusive: The subject cannot run programs in its current state.
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
    """Yield a bench on which a program runs that waits for a few seconds.

    Raises:
        CaseFailed: The subject runs no programs.
        CaseInconclusive: The subject cannot run programs in its current state.
        CaseSkipped: The subject answers no query while a program runs (A-4-3).
    """
    with bench(subject, line) as robot:
        robot.start(wait(robot.theirs_s(_RUNS_S)))
        require_known_responsive(subject, line)
        yield robot
