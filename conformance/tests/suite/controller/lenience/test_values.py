"""Conforming controllers that print and accept values according to readings of their own."""

import struct
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, Skipped, SkipReason
from scaraspec.protocol.payloads import Acceptance, NameListPart
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import Silence, refused
from scaraspec.virtual_controller.behaviour.programs import list_parts
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.session import Request, Session
from scaraspec.virtual_controller.store import Store

RunCases = Callable[..., Any]


class IgnoresMalformed(ControllerCore):
    """A request with an invalid payload is not answered."""

    def _reply(self, session: Session, command: Any, frame: Frame, answer: Any) -> None:
        if command.request.fields and self._value(command, frame) is None:
            answer = SILENCE
        super()._reply(session, command, frame, answer)


class IgnoresFurtherOutputs(ControllerCore):
    """A port that 0x49 does not report is not answered (A-4.32-2)."""

    def set_digital_output(self, request: Request) -> Any:
        return super().set_digital_output(request) if request.value.port <= 16 else SILENCE


class ClosesAtFurtherOutputs(ControllerCore):
    """A port that 0x49 does not report closes the connection (A-3-9)."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        value = self._value(BY_NAME["set_digital_output"], frame) if frame.opcode == 0x43 else None
        if value is not None and value.port > 16:
            self._end(session, now_s)
        else:
            super().handle(session, frame, now_s)


class EndsWithBar(ControllerCore):
    """The running program and the joint angles end with a bar (A-T-4)."""

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode in (0x0A, 0x3C) and b"|" in frame.data:
            frame = Frame(C2A, frame.opcode, frame.data + b"|")
        super().emit(session, frame)


class StoresFloats(ControllerCore):
    """Numbers are stored as floats of 4 bytes and printed with six decimals (A-T-5)."""

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode in (0x34, 0x37):
            numbers = map(float, frame.data.split(b"|"))
            singles = struct.unpack("6f", struct.pack("6f", *[*numbers, 0.0, 0.0, 0.0][:6]))
            count = 1 + frame.data.count(b"|")
            frame = Frame(C2A, frame.opcode, b"|".join(b"%f" % n for n in singles[:count]))
        super().emit(session, frame)


@pytest.mark.parametrize(
    ("core", "only"),
    [
        (StoresFloats, ("4.20/3", "4.21/3")),
        (EndsWithBar, ("4.9/2", "4.27/2")),
        (IgnoresFurtherOutputs, ("4.32/4", "4.32/5")),
        (ClosesAtFurtherOutputs, ("4.32/4", "4.32/5")),
        (IgnoresMalformed, ("4.4/5", "4.5/5", "4.11/4", "4.13/5", "4.20/4", "4.21/4", "4.33/3")),
    ],
)
def test_open_behaviour_passes(
    run_cases: RunCases, core: type[ControllerCore], only: tuple[str, ...]
) -> None:
    """Every case of these requirements passes or is tolerated."""
    assert not run_cases(core, *only).not_passed


class AcceptsAnyEndByte(ControllerCore):
    """Any byte is accepted as the end byte of a frame."""

    def _process_items(self, session: Session, found: list[Any], now_s: float) -> None:
        for index, item in enumerate(found):
            if isinstance(item, Skipped) and item.reason is SkipReason.BAD_END:
                found[index] = Frame(A2C, item.data[1], item.data[3:-1])
        super()._process_items(session, found, now_s)


def test_accepted_wrong_end_byte_is_tolerated(run_cases: RunCases) -> None:
    """The handling of a wrong end byte is open (A-3-10)."""
    framewise = DEFAULT.replace(resync="framewise")
    cases = run_cases(AcceptsAnyEndByte, "3/20", dialect=framewise)
    assert not cases.not_passed
    assert cases["3/20.end"].verdict is Verdict.TOLERATED


class EndsWithNul(ControllerCore):
    """Every text ends with a NUL, also an empty one (A-T-3)."""

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode in (0x08, 0x0A, 0x0B, 0x0D, 0x13):
            frame = Frame(C2A, frame.opcode, frame.data + b"\0")
        super().emit(session, frame)


def test_missing_default_program_may_be_a_nul(run_cases: RunCases) -> None:
    """Without a default program, the reply may be an empty text with a NUL (A-4.12-2, A-T-3)."""
    assert not run_cases(EndsWithNul, "4.12/4", "4.12/3", "4.13/5").problems


def test_a_binary_flag_may_end_with_a_nul(run_cases: RunCases) -> None:
    """Without a running program, the reply may be two zero bytes (A-T-1, A-T-3)."""
    binary = DEFAULT.replace(runinfo_binary="binary")
    assert not run_cases(EndsWithNul, "4.9/2", "4.9/6", dialect=binary).problems


class EndsAllWithNul(ControllerCore):
    """The data of every reply and every result end with a NUL."""

    field_end = b"|"

    def emit(self, session: Session, frame: Frame) -> None:
        data = frame.data.replace(b"|", self.field_end)
        super().emit(session, frame._replace(data=data + b"\0"))


class EndsFieldsWithNul(EndsAllWithNul):
    """There is also a NUL before each bar."""

    field_end = b"\0|"


def test_nul_after_fixed_lengths(run_cases: RunCases) -> None:
    """A NUL may end flags, codes, times and results, but must not be before a bar (A-T-3)."""
    cases = run_cases(EndsAllWithNul, "4.6/2", "4.25/3")
    assert not cases.problems
    assert cases["T/4.seen-1"].verdict is Verdict.TOLERATED
    assert run_cases(EndsFieldsWithNul, "4.31/2").violated


class SendsLowerCase(ControllerCore):
    """Codes are in lower case (A-T-7)."""

    def emit(self, session: Session, frame: Frame) -> None:
        super().emit(session, frame._replace(data=frame.data.lower()))


def test_codes_in_lower_case_are_reported(run_cases: RunCases) -> None:
    """A fault of several joints has a letter in its code."""
    cases = run_cases(SendsLowerCase, "8/2", hooks=("motor_fault", "clear_faults"))
    assert not cases.problems
    assert cases["8/2.seen-1"].verdict is Verdict.TOLERATED


class MixesOutputValues(ControllerCore):
    """Values from 2 to 9 are used as 1 by some ports; other values are refused (A-4.32-4)."""

    ports: frozenset[int] = frozenset()

    def _value(self, command: Any, frame: Frame) -> Any:
        port, _, value = frame.data.partition(b"|")
        if (
            command.name == "set_digital_output"
            and value in (b"2", b"9")
            and int(port) in self.ports
        ):
            frame = frame._replace(data=port + b"|1")
        return super()._value(command, frame)


@pytest.mark.parametrize("ports", [range(1, 17, 2), range(2, 17, 2)])
def test_output_values_may_be_mixed(run_cases: RunCases, ports: range) -> None:
    """Each port may use another value as 1 or refuse it."""
    core = type("Mixes", (MixesOutputValues,), {"ports": frozenset(ports)})
    assert not run_cases(core, "4.32/7").problems


class HasLongDefaultName(ControllerCore):
    """The default program was delivered with the robot and has a name of 40 bytes (A-4.9-5)."""

    name = b"delivered-with-the-robot-in-the-year.rob"
    last_store: Store

    def __init__(self, plant: Plant, store: Store, dialect: Dialect) -> None:
        if self.name not in store:
            store.write(self.name, b"SCARA")
            store.save(replace(store.settings, default_program=self.name))
        HasLongDefaultName.last_store = store
        super().__init__(plant, store, dialect.replace(name_max="255"))


def test_default_program_with_a_long_name_is_restored(run_cases: RunCases) -> None:
    """The default program is restored with all reported bytes, not only the first 30."""
    assert not run_cases(HasLongDefaultName, "4.13/3").not_passed
    assert HasLongDefaultName.last_store.settings.default_program == HasLongDefaultName.name


class SendsListSlowly(ControllerCore):
    """Many programs were delivered with the robot.

    The parts of their list are sent at intervals (A-4.10-3).
    """

    def __init__(self, plant: Plant, store: Store, dialect: Dialect) -> None:
        for number in range(60):
            store.write(b"delivered-%d.rob" % number, b"SCARA")
        super().__init__(plant, store, dialect)
        self._due: list[tuple[float, Session, Frame]] = []

    def list_programs(self, request: Request) -> NameListPart:
        first, *rest = list_parts(self.store.names())
        for number, part in enumerate(rest, 1):
            frame = Frame(C2A, request.frame.opcode, request.command.reply.encode(part, DEFAULT))
            self._due.append((request.now_s + number * 0.04, request.session, frame))
        return first

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        while self._due and self._due[0][0] <= now_s:
            self.emit(*self._due.pop(0)[1:])

    @property
    def next_event_s(self) -> float | None:
        times_s = (*(due[0] for due in self._due[:1]), super().next_event_s)
        return min((time_s for time_s in times_s if time_s is not None), default=None)


def test_list_may_be_sent_slowly(run_cases: RunCases) -> None:
    """The suite waits for the end of a list before it requests the next one."""
    assert not run_cases(SendsListSlowly, "4/8", "4.10/4", "5.4/8").problems


class KeepsDefaultProgram(ControllerCore):
    """The default program cannot be deleted (A-4.11-1)."""

    def delete_program(self, request: Request) -> bool:
        kept = request.value == self.store.settings.default_program
        return not kept and super().delete_program(request)


def test_default_program_that_stays_is_reported(run_cases: RunCases) -> None:
    """A program that the suite made the default program may stay (A-4.11-1).

    No requirement is violated. The remaining file is reported.
    """
    (message,) = run_cases(KeepsDefaultProgram, "4.13/3").problems
    assert "(the default program) was not listed at the start" in message


class KeepsFutureDefault(KeepsDefaultProgram):
    """A missing program can be set as default (A-4.13-1) and cannot be deleted later (A-4.11-1)."""

    def set_default_program(self, request: Request) -> bool:
        return self.save(default_program=request.value)


def test_default_program_that_is_stored_later_stays(run_cases: RunCases) -> None:
    """A sequence sets a missing program as default and stores it later."""
    (message,) = run_cases(KeepsFutureDefault, "3/31", examples=10).problems
    assert "(the default program) was not listed at the start" in message


class BigEndianChunks(ControllerCore):
    """The numbers of a chunk are big-endian; those of a program are little-endian."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        return request.frame.data[8:11] == bytes(3) and super().upload_chunk(request)

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x56:
            header = b"".join(frame.data[at : at + 4][::-1] for at in (0, 4, 8))
            frame = frame._replace(data=header + frame.data[12:])
        super().emit(session, frame)

    def is_program(self, name: bytes) -> bool:
        """Only little-endian programs of the default layout are listed."""
        content = self.store.read(name) if name in self.store else b""
        nodes, variables = struct.unpack_from("<8xII", content) if len(content) > 16 else (0, 0)
        return name in self.store and len(content) == 97 + 64 * nodes + 28 * variables

    def run_program(self, request: Request) -> Acceptance | Silence:
        name = request.value
        if self.robot.task is None and name in self.store and not self.is_program(name):
            return refused("20")
        return super().run_program(request)


def test_chunks_and_programs_may_differ_in_their_byte_order(run_cases: RunCases) -> None:
    """Each byte order is an open point of its own (A-5-2, A-6.1-4)."""
    cases = run_cases(BigEndianChunks, "4.8/4", "4.9/2", "4.10/11", "4.11/3", "5.2/12", "6.5/26")
    assert not cases.problems


class RestrictsPasswords(ControllerCore):
    """A password has six to sixteen letters and digits and differs from the previous one."""

    def set_password(self, request: Request) -> bool:
        old, new = request.value
        good = 6 <= len(new) <= 16 and new.isalnum() and new != old
        return good and super().set_password(request)


def test_passwords_may_be_restricted(run_cases: RunCases) -> None:
    """The length and the characters of a password are open (A-4.1-3)."""
    cases = run_cases(RestrictsPasswords, "4.2/3", "4.2/4", "4.2/6", examples=20)
    assert not cases.not_passed
    assert cases["4.2/4"].verdict is Verdict.TOLERATED


class NotConfigured(ControllerCore):
    """The default program is missing and the initial position is invalid: both are refused."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.save(initial_tool_position=(0.0,) * 6, default_program=b"gone.rob")

    def get_default_program(self, _: Request) -> bytes:
        return self.store.settings.default_program


def test_settings_that_cannot_be_restored(run_cases: RunCases) -> None:
    """A setting that the SUT refuses to restore from the start makes no case inconclusive."""
    cases = run_cases(NotConfigured, "4.13/3", "4.21/3", "4.13/2")
    assert not cases.not_passed


@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
def test_encoding_of_names_is_reported(run_cases: RunCases, encoding: str) -> None:
    """The refused names are not valid in the encoding that is accepted (A-T-2)."""
    case = run_cases(ControllerCore, "T/8", actual=DEFAULT.replace(text_encoding=encoding))["T/8"]
    assert case.verdict is Verdict.TOLERATED
    assert case.observed == f"text_encoding = {encoding}"
