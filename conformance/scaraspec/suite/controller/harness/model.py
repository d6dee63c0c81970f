"""Model: what a subject has to be like after all that it was asked, step by step.

It remembers the requests: files, settings, outputs, what executes. A step that has no meaning
where it stands, as asking for a default program before one was named, is passed over, so that
whatever is left of a sequence is a sequence again. What may be refused for a listed reason is taken
from the reply, and nothing is expected where the document leaves the outcome open.
"""

import itertools
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import datetime, timedelta
from typing import Final, NamedTuple

from scaraspec.protocol.commands import Point, Pose, RunningProgram
from scaraspec.protocol.fields import show
from scaraspec.protocol.transfer import chunks_of
from scaraspec.suite.controller.harness.controller_under_test import (
    SILENCE_S,
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import (
    Reading,
    expect_ran,
    read,
    set_to,
    shifted,
)
from scaraspec.suite.controller.harness.requests.files import download, send
from scaraspec.suite.controller.harness.requests.motion import (
    IDLE,
    REACHED,
    is_responsive,
    pose_deviation,
    pose_of,
    status_behind,
    stop,
    stop_motion,
    target,
)
from scaraspec.suite.controller.harness.requests.passwords import (
    change,
    expect_changed,
    usable_passwords,
)
from scaraspec.suite.controller.harness.requests.ports import (
    ALL_OUTPUTS,
    Bits,
    digits,
    outputs,
    set_output,
    settable,
    with_port,
)
from scaraspec.suite.controller.harness.requests.poses import expect_numbers, gripper_of, initial_of
from scaraspec.suite.controller.harness.requests.queries import known_to
from scaraspec.suite.controller.harness.state.defaults import expect_default
from scaraspec.suite.controller.harness.state.preserve import alive
from scaraspec.suite.controller.harness.suite_passwords import PLAIN_PASSWORD
from scaraspec.suite.controller.harness.two_stage.commands import (
    MOVE,
    RUN,
    SIMULATE,
    STATES,
    STOP,
    expect_accepted,
    try_request,
)
from scaraspec.suite.controller.harness.two_stage.results import expect_success, stop_while_idle
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect, expect_equal
from scaraspec.suite.program_files.layout import configured, layout_in_use
from scaraspec.suite.program_files.listed import program_names, store_program
from scaraspec.suite.program_files.writing import endless_program, program_file, wait
from scaraspec.user_message import UserMessage

VALUES: Final = 4
"""How many values each number of a step may have."""

_LINES: Final = 2
_ENDLESS: Final = 2  # the value from which on a program does not end
_CONSTANT: Final = ("get_version", "get_network")
_CENTRES: Final = (Point(0, 0, 0), Point(12.5, -3, 40), Point(-7, 0.5, 0), Point(0, 8, -1.5))
_DAYS: Final = (3, -5, 40, -30)  # by which the clock is set aside
_YEARS: Final = range(2001, 2099)
_SUMMER: Final = datetime(2024, 6, 15, 12)  # noqa: DTZ001 - the document names no zone
_ALL_OFF: Final = (False,) * len(ALL_OUTPUTS)
_IDLE_STOP: Final = "stop nothing"
_SWITCHED_OFF_BY: Final = [
    frozenset(chosen)
    for count in range(5)
    for chosen in itertools.combinations((RUN, SIMULATE, STOP, _IDLE_STOP), count)
]
"""What switches all outputs off: each controller does it at some of these events (A-4.32-3)."""
_TOLD: Final = 8
"""How many of the last steps of a failing sequence the message has."""
_MEANWHILE: Final = frozenset(
    {"look", "query", "get_clock", "get_outputs", "run", "simulate", "stop"}
)
"""What is done while a program executes; before all else it is stopped."""


class Step(NamedTuple):
    """One step; which numbers it heeds is its own affair.

    Attributes:
        act: What is done: a method of `Model`.
        which: Of the names.
        value: Of what is set.
        line: Of the connections.
    """

    act: str
    which: int
    value: int
    line: int


class Model:
    """What the subject has to be like, and the connections over which it is asked.

    Args:
        subject: The subject.
        acts: What may be done to it.
        names: The names of the files that may be made.

    Attributes:
        told: What was done, in words.
    """

    def __init__(
        self, subject: ControllerUnderTest, acts: list[str], names: Sequence[bytes]
    ) -> None:
        self.told: list[str] = []
        self._subject, self._acts, self._names = subject, acts, names
        self._password = subject.password
        self._lines = [self._connection()]
        if subject.supports_multiple_connections:
            self._lines += [self._connection() for _ in range(_LINES - 1)]
        self._constant: dict[str, bytes] = {}
        self._files: dict[bytes, bytes] = {}
        self._endless: list[bytes] = []
        self._fetching: OutgoingConnection | None = None
        self._default: bytes | None = None
        self._named: bytes | None = None  # the last that was taken for the default, stored or not
        self._centre: Point | None = None
        self._recentred = False
        self._initial: Pose | None = None
        self._clock: Reading | None = None
        self._running: tuple[str, bytes, OutgoingConnection] | None = None
        if {"set_initial", "move"} & set(acts):
            self._here = pose_of(self._lines[0])
        self._outputs: dict[frozenset[str], Bits] = {}  # by what switches all off
        if "set_output" in acts:
            self._ports = settable(self._lines[0])
            self._before = outputs(self._lines[0])
            self._outputs = dict.fromkeys(_SWITCHED_OFF_BY, self._before)

    def take(self, step: Step) -> None:
        """Do a step, and check what follows from it.

        Raises:
            CaseFailed: The subject is not as it has to be; the message has the steps before.
        """
        act: Callable[[Step, OutgoingConnection], str | None] = getattr(self, f"_{step.act}")
        line = self._lines[step.line % len(self._lines)]
        try:
            if self._running and step.act not in _MEANWHILE:
                self._stop(step, line)
                self.told.append("stop")
            said = act(step, line)
        except CaseFailed as error:
            self._tell(error, step.act)
            raise
        if said:
            self.told.append(said)

    def check(self) -> None:
        """Look at all that is known.

        Raises:
            CaseFailed: The subject is not as it has to be; the message has the steps before.
        """
        for act in dict.fromkeys(self._acts):
            if act == "download":
                for which in range(len(self._files)):
                    self.take(Step(act, which, 0, 0))
            elif act.startswith(("look", "list_", "get_")):
                self.take(Step(act, 0, 0, 0))

    def take_away(self) -> None:
        """Stop what executes, take away all files, and end the connections.

        Raises:
            CaseFailed: The subject does not obey.
        """
        try:
            line = self._lines[0] = alive(self._subject, self._lines[0])
            if self._subject.moved:
                stop_motion(self._subject, line)
            self._settle_transfer(line)
            for name in self._files:
                if not line.ask("delete_program", data=name).accepted and name == self._named:
                    self._let_go(name, line)
            if "set_output" in self._acts:
                for port in self._ports:
                    if any(
                        self._before[port - 1] != bits[port - 1] for bits in self._outputs.values()
                    ):
                        set_output(line, port, on=self._before[port - 1])
            if self._password != self._subject.password:
                change(line, self._password, self._subject.password)
        finally:
            self._subject.close_lines()

    def _let_go(self, name: bytes, line: OutgoingConnection) -> None:
        """Delete a program that had to stay as long as it was the default one (A-4.11-1)."""
        line.ask("set_default_program", store_program(self._subject, line))
        line.ask("delete_program", data=name)

    def _tell(self, error: CaseFailed, act: str) -> None:
        behind = "; ".join(self.told[-_TOLD:]) or "nothing"
        more = f"… {len(self.told) - _TOLD} steps; " if len(self.told) > _TOLD else ""
        error.args = (f"{error}, in {act} behind: {more}{behind}",)
        if isinstance(error, NoReply):
            error.requirement = error.requirement or error.owed

    def _name(self, step: Step) -> bytes:
        """A file, or for the last of the numbers a name that is perhaps none."""
        if self._files and step.which < VALUES - 1:
            return list(self._files)[step.which % len(self._files)]
        return self._names[step.value % len(self._names)]

    # ------------------------------------------------------------------ connections

    def _connection(self) -> OutgoingConnection:
        if self._password == self._subject.password:
            return self._subject.open()
        line = self._subject.open(login=False)
        self._subject.log_in(line, self._password)
        return line

    def _reconnect(self, step: Step, line: OutgoingConnection) -> str | None:
        line.close()
        self._lines[step.line % len(self._lines)] = self._connection()
        return f"connect anew ({step.line % len(self._lines)})"

    def _log_in(self, _: Step, line: OutgoingConnection) -> str | None:
        if not self._subject.access.needs_login:
            return None
        self._subject.log_in(line, self._password)
        return "log in again"

    def _log_in_wrongly(self, _: Step, _line: OutgoingConnection) -> str | None:
        if not (self._subject.supports_multiple_connections and self._subject.access.needs_login):
            return None
        if not self._subject.may_try_wrong_password():
            return None
        other = self._subject.open(login=False)
        try:
            answer = other.ask("login", b"no-" + self._password)
        except NoReply:
            silent = other.ending is None
            other.close()
            if silent and self._serves_a_third():
                raise
            return None  # it serves no more than two (A-2-2)
        expect(
            answer.accepted is False,
            "a wrong password opens",
            expected="0",
            observed=f"{answer}",
            requirement="4.1/3",
        )
        with suppress(NoReply):  # it may end the connection; two in a row may lock us out
            other.ask("login", self._password)
        other.close()
        return "log in wrongly elsewhere"

    def _serves_a_third(self) -> bool:
        """Whether one more connection is answered: some are let in when another one leaves."""
        third = self._subject.open(login=False)
        try:
            return third.ask("login", self._password).accepted is True
        except NoReply:
            return False
        finally:
            third.close()

    def _set_password(self, step: Step, line: OutgoingConnection) -> str | None:
        if not self._subject.access.needs_login:
            return None
        passwords = (self._subject.password, *usable_passwords(self._subject))
        new = passwords[step.value % len(passwords)]
        if not expect_changed(line, self._password, new):
            return f"set the password {show(new)}, refused"
        self._password = new
        self._all_anew("4.2/4", "the new password does not open the next login")
        return f"set the password {show(new)}"

    def _mistake_password(self, _: Step, line: OutgoingConnection) -> str | None:
        if not self._subject.access.needs_login or not self._subject.may_try_wrong_password():
            return None
        answer = change(line, self._password + b"-no", PLAIN_PASSWORD)
        expect(
            answer.accepted is False,
            "the password was changed although the old one was wrong",
            expected="0",
            observed=f"{answer}",
            requirement="4.2/3",
        )
        self._all_anew("4.2/5", "the password does not open the next login")
        return "mistake the old password"

    def _all_anew(self, requirement: str, message: str) -> None:
        """Connect again: the login may be lost (A-4.2-2)."""
        for line in self._lines:
            line.close()
        try:
            self._lines = [self._connection() for _ in self._lines]
        except NoReply:
            raise
        except CaseFailed as error:
            raise CaseFailed(message, observed=error.observed, requirement=requirement) from None

    # ------------------------------------------------------------------ asking

    def _query(self, step: Step, line: OutgoingConnection) -> str | None:
        queries = known_to(self._subject)
        query = queries[(step.which * VALUES + step.value) % len(queries)]
        if self._deaf:
            return None
        if query.name == "list_programs":  # the whole of it: the rest would be the next one's
            program_names(self._subject, line)
            return query.name
        data = line.ask(*query).frame.data
        if query.name in _CONSTANT:
            expect_equal(
                show(data),
                show(self._constant.setdefault(query.name, data)),
                UserMessage("{query} is answered otherwise than before", query=query.name),
                requirement="4.7/4" if query.name == "get_version" else "4.3/2",
            )
        return query.name

    @property
    def _deaf(self) -> bool:
        """Whether a command executes and the robot answers nothing until it ends (A-4-3)."""
        return self._running is not None and not is_responsive(self._subject, self._running[2])

    def _look(self, _: Step, line: OutgoingConnection) -> str | None:
        if self._deaf:
            return None
        self._expect_executing(line)
        return "look"

    def _expect_executing(self, line: OutgoingConnection) -> None:
        """The status and the reported program are those of what executes."""
        if self._is_over(within_s=0):
            return
        command, name = self._running[:2] if self._running else ("", b"")
        status = line.ask("get_status") if command else status_behind(line)
        told = line.ask("get_running_program")
        due = STATES[command] if command else IDLE
        if status.value != due and self._is_over(within_s=SILENCE_S):
            return
        expect(
            status.value == due,
            UserMessage(
                "the status is {status_value} while {value} executes",
                status_value=status.value,
                value=command or "nothing",
            ),
            expected=due,
            observed=f"{status}",
            requirement={RUN: "4.8/4", SIMULATE: "4.8/5"}.get(command, "4.8/3"),
        )
        running = told.value if isinstance(told.value, RunningProgram) else None
        if command == RUN or (running and command):  # a simulation need not be told (A-4.9-4)
            expect(
                running is not None and running.name == name,
                "another program is told than the one that runs",
                expected=show(name),
                observed=f"{told}",
                requirement="4.9/4" if running else "4.9/2",
            )
        elif running:
            message = "a program is told although none runs"
            raise CaseFailed(message, expected="0", observed=f"{told}", requirement="4.9/6")

    # ------------------------------------------------------------------ files

    def _content(self, line: OutgoingConnection, value: int) -> bytes:
        """Programs that do nothing, of several sizes, and one that does not end."""
        dialect, layout = self._subject.dialect, layout_in_use(self._subject)
        base = configured(self._subject, line)
        if value >= _ENDLESS:
            return endless_program(dialect, layout=layout, base=base)
        return program_file(dialect, wait(0) * (1 + 2 * value), layout=layout, base=base)

    def _upload(self, step: Step, line: OutgoingConnection) -> str | None:
        name, content = self._names[step.which % len(self._names)], self._content(line, step.value)
        self._settle_transfer(line)
        answer, there = line.ask("upload_name", data=name), name in self._files
        expect(
            answer.accepted is not there,
            UserMessage(
                "{name} was {value} although there is {value_2}",
                name=show(name),
                value="accepted" if there else "refused",
                value_2="one" if there else "none",
            ),
            expected="0" if there else "1",
            observed=f"{answer}",
            requirement="5.2/3" if there else "5.2/2",
        )
        if there:
            return f"upload {show(name)} again"
        for chunk in chunks_of(content):
            send(line, chunk)
        self._files[name] = content
        if step.value >= _ENDLESS:
            self._endless.append(name)
        return f"upload {show(name)} of {len(content)} bytes"

    def _download(self, step: Step, line: OutgoingConnection) -> str | None:
        name = self._name(step)
        self._settle_transfer(line)
        got, due = download(line, name), self._files.get(name)
        self._fetching = line
        if due is None:
            message = UserMessage("{name} is not there and was promised", name=show(name))
            expect(got is None, message, expected="0", observed="1", requirement="5.3/3")
        else:
            expect(
                got == due,
                UserMessage("{name} is not what was uploaded", name=show(name)),
                expected=f"{len(due)} bytes",
                observed="0" if got is None else f"{len(got)} bytes",
                requirement="5.2/12",
            )
        return f"download {show(name)}"

    def _delete(self, step: Step, line: OutgoingConnection) -> str | None:
        name = self._name(step)
        self._settle_transfer(line)
        answer, there = line.ask("delete_program", data=name), name in self._files
        if there and not answer.accepted and self._is_default(name, line):  # A-4.11-1
            return f"delete {show(name)}, refused"
        expect(
            answer.accepted is there,
            UserMessage(
                "{name} was {value}deleted although there is {value_2}",
                name=show(name),
                value="not " if there else "",
                value_2="one" if there else "none",
            ),
            expected="1" if there else "0",
            observed=f"{answer}",
            requirement="4.11/2" if there else "4.11/4",
        )
        self._files.pop(name, None)
        self._endless = [each for each in self._endless if each != name]
        if there and name == self._named:
            self._named = self._default = None
        return f"delete {show(name)}"

    def _is_default(self, name: bytes, line: OutgoingConnection) -> bool:
        """Whether this is the default program, perhaps since an earlier sequence (A-4.13-1)."""
        if name == self._named:
            return True
        with suppress(CaseFailed):  # without a default program there may be no reply (A-4.12-2)
            return bool(line.ask("get_default_program").value == name)
        return False

    def _settle_transfer(self, line: OutgoingConnection) -> None:
        """Let a download be over for the subject, too, before another connection is used for files.

        The answer to the last chunk has no reply; a file in transfer may be kept (A-4.11-1), and
        there may be one transfer at a time (A-5-17).
        """
        fetching, self._fetching = self._fetching, None
        if fetching not in (None, line) and not fetching.closed and fetching.ending is None:
            fetching.sync()

    def _list_programs(self, _: Step, line: OutgoingConnection) -> str | None:
        listed = [name for name in program_names(self._subject, line) if name in self._names]
        for name in self._names:
            if (name in listed) is not (name in self._files):
                raise CaseFailed(
                    UserMessage(
                        "{name} is {value}listed",
                        name=show(name),
                        value="" if name in listed else "not ",
                    ),
                    expected=" ".join(map(show, sorted(self._files))) or "none",
                    observed=" ".join(map(show, listed)) or "none",
                    requirement="4.10/11" if name in self._files else "4.11/3",
                )
        return "list"

    def _set_default(self, step: Step, line: OutgoingConnection) -> str | None:
        name = self._name(step)
        answer = line.ask("set_default_program", name)
        if name in self._files:
            expect(
                answer.accepted,
                UserMessage(
                    "{name}, which is stored, cannot be made the default program", name=show(name)
                ),
                expected="1",
                observed=f"{answer}",
                requirement="4.13/2",
            )
            self._default = name
        elif answer.accepted:  # which is only warned of (A-4.13-1)
            self._default = None
        if answer.accepted:
            self._named = name
        return f"make {show(name)} the default"

    def _get_default(self, _: Step, line: OutgoingConnection) -> str | None:
        if self._default is None:  # there may be none, and no answer (A-4.12-2)
            return None
        expect_default(self._subject, line, self._default, "4.13/3")
        return "ask for the default"

    # ------------------------------------------------------------------ settings

    def _set_centre(self, step: Step, line: OutgoingConnection) -> str | None:
        wanted = _CENTRES[step.value]
        if line.ask("set_gripper_center", wanted).accepted:
            self._centre, self._recentred = wanted, True
        return f"set the gripper centre {tuple(wanted)}"

    def _set_initial(self, step: Step, line: OutgoingConnection) -> str | None:
        x, y, z, theta_x, *_ = (round(value, 1) for value in self._here)
        aside = self._subject.ics.motion.step_mm * step.value / VALUES
        wanted = Pose(x, round(y + aside, 1), z, theta_x, 0, 0)
        if line.ask("set_initial_tool_position", wanted).accepted:  # it may be out of reach
            self._initial = wanted
        return f"set the initial position {tuple(wanted)}"

    def _get_poses(self, _: Step, line: OutgoingConnection) -> str | None:
        if self._centre:
            message = "0x34 does not give the gripper centre that was set"
            expect_numbers(gripper_of(line), self._centre, message, "4.20/3")
        if self._initial:
            message = "0x37 does not give the initial position that was set"
            expect_numbers(initial_of(line)[:4], self._initial[:4], message, "4.21/3")
        return "ask for the poses"

    def _set_clock(self, step: Step, line: OutgoingConnection) -> str | None:
        time = shifted(read(self._subject, line).time, timedelta(days=_DAYS[step.value]))
        if time.year not in _YEARS:
            time = _SUMMER
        self._clock = set_to(self._subject, line, time)
        return f"set the clock {self._clock.time}"

    def _get_clock(self, _: Step, line: OutgoingConnection) -> str | None:
        if self._deaf:
            return None
        now = read(self._subject, line)
        if self._clock:
            message = "the clock does not go on from what was set"
            expect_ran(self._subject, self._clock, now, message, "4.5/4")
        return "ask for the time"

    # ------------------------------------------------------------------ outputs and motion

    def _set_output(self, step: Step, line: OutgoingConnection) -> str | None:
        port, on = self._ports[step.which % len(self._ports)], bool(step.value % 2)
        answer = set_output(line, port, on=on)
        expect(
            answer.accepted,
            UserMessage(
                "output {port}, which could be set before, cannot be set to {on:d}",
                port=port,
                on=on,
            ),
            expected="1",
            observed=f"{answer}",
            requirement="4.32/4",
        )
        self._outputs = {by: with_port(bits, port, on=on) for by, bits in self._outputs.items()}
        return f"set output {port} to {on:d}"

    def _get_outputs(self, _: Step, line: OutgoingConnection) -> str | None:
        if self._deaf:
            return None
        shown, as_set = outputs(line), self._outputs[frozenset()]
        if shown != as_set and shown in self._outputs.values():
            told = "a program that begins, or is stopped, switches the outputs off"
            self._subject.tolerate("4.32/6", "A-4.32-3", "off", told)
        else:
            message = "the outputs are others than were set"
            expect_equal(digits(shown), digits(as_set), message, requirement="4.32/6")
        self._outputs = dict.fromkeys(_SWITCHED_OFF_BY, shown)
        return "ask for the outputs"

    def _may_switch_off(self, event: str) -> None:
        for by in self._outputs:
            if event in by:
                self._outputs[by] = _ALL_OFF

    def _run(self, step: Step, line: OutgoingConnection) -> str | None:
        return self._begin(RUN, self._name(step), line)

    def _simulate(self, step: Step, line: OutgoingConnection) -> str | None:
        return self._begin(SIMULATE, self._name(step), line)

    def _interrupt(self, step: Step, line: OutgoingConnection) -> str | None:
        """Begin what does not end, be refused another command perhaps, and stop it."""
        uploaded = ""
        if not self._endless:
            uploaded = f"{self._upload(step._replace(value=_ENDLESS), line)}; "
            if not self._endless:  # the name was taken
                return uploaded.rstrip("; ")
        command, other = (RUN, SIMULATE) if step.value % 2 else (SIMULATE, RUN)
        begun = self._begin(command, self._endless[0], line)
        refused = self._expect_busy(other, self._name(step), line) if step.value > 1 else None
        self._stop(step, line)
        return uploaded + "; ".join(filter(None, (begun, refused, "stop")))

    def _begin(self, command: str, name: bytes, line: OutgoingConnection) -> str | None:
        if self._running and not self._is_over(within_s=0):
            return self._expect_busy(command, name, line)
        self._subject.moved = True
        answer = line.ask(command, name)
        if name not in self._files:
            if answer.accepted:  # it may fail late (A-4.15-1)
                result = line.result(command)
                message = UserMessage(
                    "{command} of a program that is not stored ends as done", command=command
                )
                expect(not result.done, message, observed=f"{result}", requirement="4.15/7")
            return f"{command} {show(name)}, which is not there"
        expect_accepted(command, answer)
        self._centre = self._initial = None  # a program brings its own, perhaps (A-6.3-3)
        self._may_switch_off(command)
        if name in self._endless:
            self._running = command, name, line
            return f"{command} {show(name)}, which does not end"
        expect_success(self._subject, line, command)
        return f"{command} {show(name)}"

    def _expect_busy(self, command: str, name: bytes, line: OutgoingConnection) -> str | None:
        if self._deaf or self._subject.dialect["busy_reply"] == "queue":
            return None
        answer = try_request(line, command, name)
        if answer is not None and answer.accepted and self._is_over(within_s=0):
            stop_motion(self._subject, line)
            return f"{command} {show(name)} behind the end of a simulation"
        expect(
            answer is None or not answer.accepted,
            UserMessage(
                "{command} is accepted while {value} executes",
                command=command,
                value=self._running[0] if self._running else "",
            ),
            expected="0|01 or 0|02",
            observed=f"{answer}",
            requirement="4/6",
        )
        self._expect_executing(line)
        return f"{command} {show(name)} meanwhile"

    def _move(self, _: Step, line: OutgoingConnection) -> str | None:
        """To where the arm stands; 0x39 may mean the gripper's centre (A-4.23-1)."""
        if self._recentred:
            return None
        self._subject.moved = True
        answer = line.ask(MOVE, target(self._here, self._subject.ics.motion.speed_percent))
        expect_accepted(MOVE, answer)
        expect_success(self._subject, line, MOVE)
        at = pose_of(line)
        expect(
            pose_deviation(at, self._here) <= REACHED,
            "behind a move the arm is not where it was to go",
            expected=f"{self._here[:4]}",
            observed=f"{at[:4]}",
            requirement="4.24/8",
        )
        return "move"

    def _is_over(self, *, within_s: float) -> bool:
        """Whether a simulation has ended by itself: a simulation may take any time."""
        if not self._running or self._running[0] != SIMULATE:
            return False
        try:
            self._running[2].result(SIMULATE, within_s=within_s)
        except NoReply:
            return False
        self._running = None
        return True

    def _stop(self, _step: Step, line: OutgoingConnection) -> str | None:
        """On the connection that began it: the others get no result."""
        self._may_switch_off(STOP if self._running else _IDLE_STOP)
        if not self._running:
            stop_while_idle(self._subject, line)
            return _IDLE_STOP
        if self._is_over(within_s=0):
            return None
        command, _name, owner = self._running
        answer = stop(self._subject, owner)
        if not answer.accepted and self._is_over(within_s=SILENCE_S):
            return None
        expect(
            answer.accepted,
            UserMessage("the stop is refused while {command} executes", command=command),
            expected="1",
            observed=f"{answer}",
            requirement="4.17/3",
        )
        self._running = None
        stop_motion(self._subject, owner)
        return "stop"
