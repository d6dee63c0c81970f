"""Mistakes of other hands in values: what is a number or a password, and what is none.

Each is found by a case of a requirement that it violates.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import Point, PortValue
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

Try = Callable[..., Any]


class ShortestText(ControllerCore):
    """Numbers are told as the programming language writes them."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write them so."""
        if frame.opcode == 0x34:
            numbers = self.store.settings.gripper_center
            frame = frame._replace(data="|".join(map(str, numbers)).encode())
        super().emit(session, frame)


class SumsItUp(ControllerCore):
    """Of a password it has kept nothing but the sum of its bytes."""

    def login(self, request: Request) -> bool:
        """Compare that."""
        right = sum(request.value) == sum(self.store.settings.password)
        request.session.logged_in |= right
        return right


class OverlooksTheLast(ControllerCore):
    """Of a password the last letter is not looked at."""

    def login(self, request: Request) -> bool:
        """Overlook it."""
        right, said = self.store.settings.password, request.value
        opens = len(said) == len(right) and said[:-1] == right[:-1]
        request.session.logged_in |= opens
        return opens


class ChangesLengths(ControllerCore):
    """A new password as long as the old one is taken for no new one."""

    def set_password(self, request: Request) -> bool:
        """Keep the old one."""
        value = request.value
        same = value is not None and len(value.new) == len(value.old)
        return (same and value.old == self.store.settings.password) or super().set_password(request)


class LimitedTenths(ControllerCore):
    """Numbers are kept as tenths in 16 bits."""

    def set_gripper_center(self, request: Request) -> bool:
        """Cut them off."""
        value = request.value and Point(*(min(each, 3276.7) for each in request.value))
        return super().set_gripper_center(replace(request, value=value))


class SmallPasswords(ControllerCore):
    """New passwords are kept in small letters."""

    def set_password(self, request: Request) -> bool:
        """Change them."""
        value = request.value
        if value is not None:
            request = replace(request, value=value._replace(new=value.new.lower()))
        return super().set_password(request)


class ComparesTheBeginning(ControllerCore):
    """Of a password sixteen letters are compared."""

    def login(self, request: Request) -> bool:
        """Compare them."""
        right, said = self.store.settings.password, request.value
        return super().login(replace(request, value=right if said[:16] == right[:16] else said))


class LeapsEveryEighthYear(ControllerCore):
    """Only every other leap year has a 29 February."""

    def set_time(self, request: Request) -> bool:
        """Refuse the others."""
        time = request.value
        refused = time is not None and (time.month, time.day) == (2, 29) and time.year % 8
        return not refused and super().set_time(request)


class KnowsItsClient(ControllerCore):
    """Who has logged in may say whatever he likes."""

    def login(self, request: Request) -> bool:
        """Believe it."""
        return request.session.logged_in or super().login(request)


class KeepsNumbers(ControllerCore):
    """A new password that is a number is kept as one."""

    def set_password(self, request: Request) -> bool:
        """Count it."""
        value = request.value
        if value is not None and value.new.isdigit():
            request = replace(request, value=value._replace(new=b"%d" % int(value.new)))
        return super().set_password(request)


class TrimsPasswords(ControllerCore):
    """New passwords lose the blanks around them."""

    def set_password(self, request: Request) -> bool:
        """Take them off."""
        value = request.value
        if value is not None:
            request = replace(request, value=value._replace(new=value.new.strip()))
        return super().set_password(request)


class PasswordBuffer(ControllerCore):
    """New passwords are cut to what a buffer of 64 bytes holds."""

    def set_password(self, request: Request) -> bool:
        """Cut it."""
        value = request.value
        if value is not None:
            request = replace(request, value=value._replace(new=value.new[:63]))
        return super().set_password(request)


class LiteralsOfALanguage(ControllerCore):
    """An initial tool position is read by what reads the literals of some language."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Understand them."""
        if frame.opcode == 0x36:
            fields = [b"0" if f in (b"NaN", b"Infinity") else f for f in frame.data.split(b"|")]
            frame = frame._replace(data=b"|".join(f.removesuffix(b"f") for f in fields))
        super().handle(session, frame, now_s)


class _Overlooks(ControllerCore):
    """It overlooks something in what it is told, or takes it for something else."""

    opcode = 0
    overlooked = b""
    taken_for = b""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take it away."""
        if frame.opcode == self.opcode:
            frame = frame._replace(data=re.sub(self.overlooked, self.taken_for, frame.data))
        super().handle(session, frame, now_s)


def overlooks(pattern: bytes, taken_for: bytes = b"", opcode: int = 0x35) -> type[ControllerCore]:
    """A controller that does, in a gripper centre if nothing else is said."""
    own = {"opcode": opcode, "overlooked": pattern, "taken_for": taken_for}
    return type("Overlooks", (_Overlooks,), own)


class PatternOfAPassword(ControllerCore):
    """The password is a pattern, which what logs in has to match."""

    def login(self, request: Request) -> bool:
        """Match it."""
        right = self.store.settings.password
        matched = re.fullmatch(right, request.value)
        return super().login(replace(request, value=right if matched else b""))


class Boundless(ControllerCore):
    """An initial tool position that was never set is what the memory held."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Tell it."""
        if frame.opcode == 0x37:
            frame = frame._replace(data=b"|".join([b"%.1f" % 3.4e38] * 6))
        super().emit(session, frame)


class Absurd(ControllerCore):
    """What it tells under one opcode is nothing that anybody could have set."""

    opcode = 0
    data = b""

    def emit(self, session: Session, frame: Frame) -> None:
        """Tell it."""
        if frame.opcode == self.opcode:
            frame = frame._replace(data=self.data)
        super().emit(session, frame)


class PointBehind(ControllerCore):
    """An address may have a point behind it."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Overlook it."""
        if frame.opcode == 0x05:
            frame = frame._replace(data=frame.data.replace(b".|", b"|"))
        super().handle(session, frame, now_s)


class TakesItsNeighbourAlong(ControllerCore):
    """Who switches output 8 off switches off the first of the next byte."""

    def set_digital_output(self, request: Request) -> bool:
        """Do both."""
        done = super().set_digital_output(request)
        if request.value == PortValue(8, 0):
            self.plant.digital_outputs[9] = False
        return done


class OtherBytes(ControllerCore):
    """Binary directions of a jog have the order of the keys on its pendant: 3 is -X."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take them so."""
        if frame.opcode == 0x3D and frame.data in (b"\3", b"\4"):
            frame = frame._replace(data=bytes((7 - frame.data[0],)))
        super().handle(session, frame, now_s)


class OffInDoubt(ControllerCore):
    """A value that is none switches the output off, and is refused."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Switch it off."""
        port, _, value = frame.data.partition(b"|")
        if frame.opcode == 0x43 and port.isdigit() and value.isdigit() and int(value) > 1:
            frame = frame._replace(data=port + b"|0")
        super().handle(session, frame, now_s)


class TakesOffZeros(ControllerCore):
    """Of the minutes of a time each character counts by how far it is from a zero."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Reckon so."""
        if frame.opcode == 0x06 and len(frame.data) == 14 and frame.data[11:12] == b":":
            tens = frame.data[10] - 0x30
            frame = frame._replace(data=frame.data[:10] + b"%d0" % (tens + 1) + frame.data[12:])
        super().handle(session, frame, now_s)


class FillsUp(ControllerCore):
    """What lacks of the 14 digits of a time, at its begin or its end, is made up for."""

    before, behind = b"", b""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Add it."""
        if frame.opcode == 0x06 and len(frame.data) == 12:
            frame = frame._replace(data=self.before + frame.data + self.behind)
        super().handle(session, frame, now_s)


class NeedsNoSeconds(FillsUp):
    """On the minute."""

    behind = b"00"


class NeedsNoCentury(FillsUp):
    """In the present one."""

    before = b"20"


class YearsOf365Days(ControllerCore):
    """The last day of a leap year is told as the one before."""

    def get_time(self, request: Request) -> datetime:
        """Tell it."""
        time = super().get_time(request)
        return time - timedelta(days=time.timetuple().tm_yday > 365)


class SevenBits(ControllerCore):
    """Of the digit of a jog the highest bit does not count."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take it off."""
        if frame.opcode == 0x3D and frame.data >= b"\xb0":
            frame = frame._replace(data=bytes(byte & 0x7F for byte in frame.data))
        super().handle(session, frame, now_s)


@pytest.mark.parametrize(
    ("core", "tries", "requirement"),
    [
        (SumsItUp, "4.1/3", "4.1/3"),
        (TakesItsNeighbourAlong, "4.32/6", "4.32/6"),
        (OffInDoubt, "4.32/7", "4.32/7"),
        (SevenBits, "4.28/7", "4.28/7"),
        (OtherBytes, "4.28/4", "4.28/3"),
        (TakesOffZeros, "4.5/5", "4.5/5"),
        (LeapsEveryEighthYear, "4.5/6", "4.5/6"),
        (PointBehind, "4.4/5", "4.4/5"),
        # The characters on both sides of the digits are none, and no sign stands behind them.
        (overlooks(rb"/"), "4.20/4", "4.20/4"),
        (overlooks(rb":"), "4.20/4", "4.20/4"),
        (overlooks(rb"-(?=\||$)"), "4.20/4", "4.20/4"),
        # Nor is what a language takes for a number in its own programs.
        (overlooks(rb"null|true", b"1"), "4.20/4", "4.20/4"),
        (overlooks(rb"0b[01]+", b"1"), "4.20/4", "4.20/4"),
        # A pattern whose end is that of a line lets another line follow.
        (overlooks(rb"\n[^|]*"), "4.20/4", "4.20/4"),
        (overlooks(rb"\n[^|]*", opcode=0x05), "4.4/5", "4.4/5"),
        (overlooks(rb"(?<=\.)0x", opcode=0x05), "4.4/5", "4.4/5"),
        (overlooks(rb"(?<=1)e1", opcode=0x05), "4.4/5", "4.4/5"),
        (overlooks(rb"\n[^|]*", opcode=0x06), "4.5/5", "4.5/5"),
        (YearsOf365Days, "4.5/6", "4.5/4"),
        (NeedsNoSeconds, "4.5/5", "4.5/5"),
        (NeedsNoCentury, "4.5/5", "4.5/5"),
        (LimitedTenths, "4.20/3", "4.20/3"),
        (ShortestText, "T/5", "T/5"),
        (Boundless, "4.21/3", "4.21/3"),
        (LiteralsOfALanguage, "4.21/4", "4.21/4"),
        (OverlooksTheLast, "4.1/3", "4.1/3"),
        (ChangesLengths, "4.2/4", "4.2/4"),
        (SmallPasswords, "4.2/4", "4.2/4"),
        (PasswordBuffer, "4.2/4", "4.2/4"),
        (TrimsPasswords, "4.2/4", "4.2/4"),
        (KeepsNumbers, "4.2/4", "4.2/4"),
        (ComparesTheBeginning, "4.1/3", "4.1/3"),
        (KnowsItsClient, "4.1/3", "4.1/3"),
        (PatternOfAPassword, "4.2/4", "4.2/4"),
    ],
)
def test_it_is_found(tried: Try, core: type[ControllerCore], tries: str, requirement: str) -> None:
    """A case of what it tries fails, for what is violated."""
    assert requirement in tried(core, tries, examples=1, handled=("factory_reset",)).failed


@pytest.mark.parametrize(
    ("opcode", "data"),
    [
        (0x07, b"99991231235959"),
        (0x07, b"00010101000000"),
        (0x34, b"1%059d|0|0" % 0),
        (0x37, b"1%059d|0|0|0|0|0" % 0),
        (0x38, b"1%059d|0|0|0|0|0" % 0),
        (0x3C, b"1%059d|0|0|0" % 0),
    ],
)
def test_no_case_breaks_down_of_an_absurd_value(tried: Try, opcode: int, data: bytes) -> None:
    """Nothing can be made of it: that is undecided, and no mistake of the suite."""
    core = type("Absurdly", (Absurd,), {"opcode": opcode, "data": data})
    only = ("2/11", "3/30", "4.5/4", "4.9/2", "5.2/12", "6.5/25", "6.5/28")
    counts = tried(core, *only).counts
    assert not counts[Verdict.ERROR]
    assert counts[Verdict.PASS]


class LivesLater(ControllerCore):
    """Its clock shows a year that no timer of 4 bytes can hold, and goes on."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Tell it."""
        if frame.opcode == 0x07:
            frame = frame._replace(data=b"20%d" % (int(frame.data[2:4]) + 70) + frame.data[4:])
        super().emit(session, frame)


def test_no_timer_is_asked_for_what_it_cannot_hold(tried: Try) -> None:
    """Whether it would wait until then is undecided."""
    assert tried(LivesLater, "6.5/22")["6.5/22"].verdict is Verdict.INCONCLUSIVE


class KeepsNoCenter(ControllerCore):
    """A gripper centre is taken, and is what it was."""

    def set_gripper_center(self, _: Request) -> bool:
        """Do nothing."""
        return True


def test_a_refusal_is_not_blamed_for_what_was_not_kept(tried: Try) -> None:
    """Where a value is not what was set, no request behind it has changed it."""
    assert "was refused" not in tried(KeepsNoCenter, "4.20/4")["4.20/4"].message
