"""Faulty controllers: how they parse, store and print numbers, passwords and other values.

For each fault, a case of the violated requirement must fail.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import Point, PortValue
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.program_files import WaitInput, WaitTimer
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.interpreter import Run
from scaraspec.virtual_controller.session import Request, Session

RunCases = Callable[..., Any]


class PrintsNumbersAsPython(ControllerCore):
    """Numbers are printed as Python prints floats."""

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x34:
            numbers = self.store.settings.gripper_center
            frame = frame._replace(data="|".join(map(str, numbers)).encode())
        super().emit(session, frame)


class ComparesPasswordSum(ControllerCore):
    """Only the sum of the bytes of a password is compared."""

    def login(self, request: Request) -> bool:
        correct = sum(request.value) == sum(self.store.settings.password)
        request.session.logged_in |= correct
        return correct


class IgnoresLastLetter(ControllerCore):
    """The last letter of a password is not compared."""

    def login(self, request: Request) -> bool:
        correct, received = self.store.settings.password, request.value
        accepted = len(received) == len(correct) and received[:-1] == correct[:-1]
        request.session.logged_in |= accepted
        return accepted


class IgnoresPasswordOfSameLength(ControllerCore):
    """A new password of the same length as the old one is not stored."""

    def set_password(self, request: Request) -> bool:
        value = request.value
        same = value is not None and len(value.new) == len(value.old)
        return (same and value.old == self.store.settings.password) or super().set_password(request)


class StoresTenthsIn16Bits(ControllerCore):
    """Numbers are stored as tenths in 16 bits."""

    def set_gripper_center(self, request: Request) -> bool:
        value = request.value and Point(*(min(number, 3276.7) for number in request.value))
        return super().set_gripper_center(replace(request, value=value))


class StoresLowercasePassword(ControllerCore):
    """New passwords are stored in lower case."""

    def set_password(self, request: Request) -> bool:
        value = request.value
        if value is not None:
            request = replace(request, value=value._replace(new=value.new.lower()))
        return super().set_password(request)


class Compares16Letters(ControllerCore):
    """Only the first 16 letters of a password are compared."""

    def login(self, request: Request) -> bool:
        correct, received = self.store.settings.password, request.value
        same = received[:16] == correct[:16]
        return super().login(replace(request, value=correct if same else received))


class LeapsEveryEighthYear(ControllerCore):
    """Only every second leap year has a 29 February."""

    def set_time(self, request: Request) -> bool:
        time = request.value
        refused = time is not None and (time.month, time.day) == (2, 29) and time.year % 8
        return not refused and super().set_time(request)


class AcceptsAnyPasswordAfterLogin(ControllerCore):
    """A client that is logged in may log in again with any password."""

    def login(self, request: Request) -> bool:
        return request.session.logged_in or super().login(request)


class StoresPasswordAsNumber(ControllerCore):
    """A new password of digits is stored as a number, without leading zeros."""

    def set_password(self, request: Request) -> bool:
        value = request.value
        if value is not None and value.new.isdigit():
            request = replace(request, value=value._replace(new=b"%d" % int(value.new)))
        return super().set_password(request)


class TrimsPasswords(ControllerCore):
    """Spaces around a new password are removed."""

    def set_password(self, request: Request) -> bool:
        value = request.value
        if value is not None:
            request = replace(request, value=value._replace(new=value.new.strip()))
        return super().set_password(request)


class TruncatesPassword(ControllerCore):
    """New passwords are truncated to 63 bytes."""

    def set_password(self, request: Request) -> bool:
        value = request.value
        if value is not None:
            request = replace(request, value=value._replace(new=value.new[:63]))
        return super().set_password(request)


class AcceptsFloatLiterals(ControllerCore):
    """An initial tool position may contain NaN, Infinity and the suffix f."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x36:
            fields = [b"0" if f in (b"NaN", b"Infinity") else f for f in frame.data.split(b"|")]
            frame = frame._replace(data=b"|".join(f.removesuffix(b"f") for f in fields))
        super().handle(session, frame, now_s)


class _Substitutes(ControllerCore):
    """Replaces a pattern in the data of a request."""

    opcode = 0
    pattern = b""
    replacement = b""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == self.opcode:
            frame = frame._replace(data=re.sub(self.pattern, self.replacement, frame.data))
        super().handle(session, frame, now_s)


def ignores(pattern: bytes, replacement: bytes = b"", opcode: int = 0x35) -> type[ControllerCore]:
    """Return a controller that replaces a pattern in the data of one request."""
    attributes = {"opcode": opcode, "pattern": pattern, "replacement": replacement}
    return type("Substitutes", (_Substitutes,), attributes)


class PasswordIsPattern(ControllerCore):
    """The stored password is a regular expression, and a login must match it."""

    def login(self, request: Request) -> bool:
        correct = self.store.settings.password
        matched = re.fullmatch(correct, request.value)
        return super().login(replace(request, value=correct if matched else b""))


class ReportsHugePosition(ControllerCore):
    """The initial tool position consists of numbers that are larger than any arm."""

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x37:
            frame = frame._replace(data=b"|".join([b"%.1f" % 3.4e38] * 6))
        super().emit(session, frame)


class RepliesConstants(ControllerCore):
    """The replies to some opcodes are always the same data."""

    data: Mapping[int, bytes]

    def emit(self, session: Session, frame: Frame) -> None:
        frame = frame._replace(data=self.data.get(frame.opcode, frame.data))
        super().emit(session, frame)


class AcceptsTrailingDot(ControllerCore):
    """An address may end with a dot."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x05:
            frame = frame._replace(data=frame.data.replace(b".|", b"|"))
        super().handle(session, frame, now_s)


class ClearsNextByte(ControllerCore):
    """Clearing output 8 also clears output 9."""

    def set_digital_output(self, request: Request) -> bool:
        done = super().set_digital_output(request)
        if request.value == PortValue(8, 0):
            self.plant.digital_outputs[9] = False
        return done


class SwapsBinaryDirections(ControllerCore):
    """The binary directions 3 and 4 of a jog are swapped."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x3D and frame.data in (b"\3", b"\4"):
            frame = frame._replace(data=bytes((7 - frame.data[0],)))
        super().handle(session, frame, now_s)


class InvalidValueClearsOutput(ControllerCore):
    """An invalid value clears the output."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        port, _, value = frame.data.partition(b"|")
        if frame.opcode == 0x43 and port.isdigit() and value.isdigit() and int(value) > 1:
            frame = frame._replace(data=port + b"|0")
        super().handle(session, frame, now_s)


class ParsesDigitByOffset(ControllerCore):
    """Each character of the minutes counts by its distance from the character 0."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x06 and len(frame.data) == 14 and frame.data[11:12] == b":":
            tens = frame.data[10] - 0x30
            frame = frame._replace(data=frame.data[:10] + b"%d0" % (tens + 1) + frame.data[12:])
        super().handle(session, frame, now_s)


class CompletesShortTime(ControllerCore):
    """A time of 12 digits is completed to 14."""

    prefix, suffix = b"", b""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x06 and len(frame.data) == 12:
            frame = frame._replace(data=self.prefix + frame.data + self.suffix)
        super().handle(session, frame, now_s)


class AcceptsTimeWithoutSeconds(CompletesShortTime):
    """A time without seconds is accepted."""

    suffix = b"00"


class AcceptsTimeWithoutCentury(CompletesShortTime):
    """A time without a century is accepted."""

    prefix = b"20"


class YearsOf365Days(ControllerCore):
    """The last day of a leap year is reported as the day before."""

    def get_time(self, request: Request) -> datetime:
        time = super().get_time(request)
        return time - timedelta(days=time.timetuple().tm_yday > 365)


class IgnoresHighestBit(ControllerCore):
    """The highest bit of the digit of a jog is ignored."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x3D and frame.data >= b"\xb0":
            frame = frame._replace(data=bytes(byte & 0x7F for byte in frame.data))
        super().handle(session, frame, now_s)


@pytest.mark.parametrize(
    ("core", "only", "requirement"),
    [
        (ComparesPasswordSum, "4.1/3", "4.1/3"),
        (ClearsNextByte, "4.32/6", "4.32/6"),
        (InvalidValueClearsOutput, "4.32/7", "4.32/7"),
        (IgnoresHighestBit, "4.28/7", "4.28/7"),
        (SwapsBinaryDirections, "4.28/4", "4.28/3"),
        (ParsesDigitByOffset, "4.5/5", "4.5/5"),
        (LeapsEveryEighthYear, "4.5/6", "4.5/6"),
        (AcceptsTrailingDot, "4.4/5", "4.4/5"),
        # The characters next to the digits in ASCII are not digits, and no sign follows a number.
        (ignores(rb"/"), "4.20/4", "4.20/4"),
        (ignores(rb":"), "4.20/4", "4.20/4"),
        (ignores(rb"-(?=\||$)"), "4.20/4", "4.20/4"),
        # Number literals of programming languages are not numbers.
        (ignores(rb"null|true", b"1"), "4.20/4", "4.20/4"),
        (ignores(rb"0b[01]+", b"1"), "4.20/4", "4.20/4"),
        # A pattern that matches the end of a line would allow a second line.
        (ignores(rb"\n[^|]*"), "4.20/4", "4.20/4"),
        (ignores(rb"\n[^|]*", opcode=0x05), "4.4/5", "4.4/5"),
        (ignores(rb"(?<=\.)0x", opcode=0x05), "4.4/5", "4.4/5"),
        (ignores(rb"(?<=1)e1", opcode=0x05), "4.4/5", "4.4/5"),
        (ignores(rb"\n[^|]*", opcode=0x06), "4.5/5", "4.5/5"),
        (YearsOf365Days, "4.5/6", "4.5/4"),
        (AcceptsTimeWithoutSeconds, "4.5/5", "4.5/5"),
        (AcceptsTimeWithoutCentury, "4.5/5", "4.5/5"),
        (StoresTenthsIn16Bits, "4.20/3", "4.20/3"),
        (PrintsNumbersAsPython, "T/5", "T/5"),
        (ReportsHugePosition, "4.21/3", "4.21/3"),
        (AcceptsFloatLiterals, "4.21/4", "4.21/4"),
        (IgnoresLastLetter, "4.1/3", "4.1/3"),
        (IgnoresPasswordOfSameLength, "4.2/4", "4.2/4"),
        (StoresLowercasePassword, "4.2/4", "4.2/4"),
        (TruncatesPassword, "4.2/4", "4.2/4"),
        (TrimsPasswords, "4.2/4", "4.2/4"),
        (StoresPasswordAsNumber, "4.2/4", "4.2/4"),
        (Compares16Letters, "4.1/3", "4.1/3"),
        (AcceptsAnyPasswordAfterLogin, "4.1/3", "4.1/3"),
        (PasswordIsPattern, "4.2/4", "4.2/4"),
    ],
)
def test_fault_is_detected(
    run_cases: RunCases, core: type[ControllerCore], only: str, requirement: str
) -> None:
    """One of the cases that run fails for the violated requirement."""
    hooks = ("factory_reset",)
    results = run_cases(core, only, examples=1, hooks=hooks, fail_fast=True)
    assert requirement in results.violated


_ABSURD_NUMBERS = {
    0x34: b"1%059d|0|0" % 0,
    0x37: b"1%059d|0|0|0|0|0" % 0,
    0x38: b"1%059d|0|0|0|0|0" % 0,
    0x3C: b"1%059d|0|0|0" % 0,
}


@pytest.mark.parametrize(
    "data",
    [{0x07: b"99991231235959"}, {0x07: b"00010101000000"}, _ABSURD_NUMBERS],
    ids=["last-time", "first-time", "numbers"],
)
def test_no_case_crashes_on_an_absurd_value(run_cases: RunCases, data: dict[int, bytes]) -> None:
    """An absurd value makes no case end with an internal error."""
    core = type("Absurd", (RepliesConstants,), {"data": data})
    only = ("2/11", "3/30", "4.5/4", "4.9/2", "5.2/12", "6.5/25", "6.5/28")
    counts = run_cases(core, *only, examples=1).counts
    assert not counts[Verdict.ERROR]
    assert counts[Verdict.PASS]


class ClockOfYear2090(ControllerCore):
    """The clock shows a year that does not fit a timer of 4 bytes."""

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x07:
            frame = frame._replace(data=b"20%d" % (int(frame.data[2:4]) + 70) + frame.data[4:])
        super().emit(session, frame)


def test_timer_case_is_inconclusive_with_a_late_clock(run_cases: RunCases) -> None:
    """The timer case is inconclusive if the time does not fit a timer."""
    assert run_cases(ClockOfYear2090, "6.5/22")["6.5/22"].verdict is Verdict.INCONCLUSIVE


class ChineseClock(ControllerCore):
    """The clock shows Chinese time; timers are in UTC."""

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x07:
            utc = datetime.strptime(frame.data.decode() + "+0000", "%Y%m%d%H%M%S%z")
            frame = frame._replace(data=f"{utc + timedelta(hours=8):%Y%m%d%H%M%S}".encode())
        super().emit(session, frame)


class ChineseClockWithoutTimers(ChineseClock):
    """The clock shows Chinese time; timers are ignored."""

    class PassesTimers(Run):
        def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
            return now_s if isinstance(wait, WaitTimer) else super()._wait_ends_s(wait, now_s)

    interpreter = PassesTimers


@pytest.mark.parametrize(
    ("core", "verdict"),
    [(ChineseClock, Verdict.TOLERATED), (ChineseClockWithoutTimers, Verdict.FAIL)],
)
def test_timers_with_another_clock(
    run_cases: RunCases, core: type[ControllerCore], verdict: Verdict
) -> None:
    """With a clock in another zone a timer can be early, but not days before its time."""
    assert run_cases(core, "6.5/22")["6.5/22"].verdict is verdict


class IgnoresGripperCenter(ControllerCore):
    """A gripper center is answered 1 and not stored."""

    def set_gripper_center(self, _: Request) -> bool:
        return True


def test_refusal_is_not_the_reported_cause(run_cases: RunCases) -> None:
    """If a setting is not stored, the message does not blame the refused request after it."""
    assert "was refused" not in run_cases(IgnoresGripperCenter, "4.20/4")["4.20/4"].message


class StoresRefusedPosition(ControllerCore):
    """A refused initial position is stored, even one that the reply cannot contain."""

    def set_initial_tool_position(self, request: Request) -> bool:
        accepted = super().set_initial_tool_position(request)
        if not accepted and request.value is not None:
            self.save(initial_tool_position=tuple(request.value))
        return accepted


def test_stored_position_that_cannot_be_reported(run_cases: RunCases) -> None:
    """A controller that cannot encode its reply ends the connection, which fails the case."""
    case = run_cases(StoresRefusedPosition, "4.21/4")["4.21/4"]
    assert case.verdict is Verdict.FAIL
    assert case.message.startswith("get_initial_tool_position was not answered")
