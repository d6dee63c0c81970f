"""Mistakes of other hands in the store: names, lists, and the default program.

Each is found by a case of a requirement that it violates.
"""

import re
from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.operators.controller.transfers import SendsAfterTheEnd
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import Acceptance, NameListPart
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, Silence, refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

Try = Callable[..., Any]


class OneByteTooMany(ControllerCore):
    """A part of the list may have 256 bytes, of which its length byte says 0."""

    def list_programs(self, request: Request) -> NameListPart | Silence:
        """Send it."""
        data = b"|".join((b"0", *self.store.names()))
        if len(data) != 256:
            return super().list_programs(request)
        self.transmit(request.session, b"\xcc\x0b\x00" + data + b"\xaa")
        return SILENCE


class HidesWhatRuns(ControllerCore):
    """The program that runs is not in the list."""

    def is_program(self, name: bytes) -> bool:
        """Whether it is listed."""
        task = self.robot.task
        return super().is_program(name) and (task is None or task.program != name)


class HidesItsDefault(ControllerCore):
    """The default program is not in the list."""

    def list_programs(self, request: Request) -> NameListPart:
        """Leave it out."""
        part = super().list_programs(request)
        hidden = self.store.settings.default_program
        return part._replace(names=tuple(name for name in part.names if name != hidden))


class ForgetsItsDefault(ControllerCore):
    """Whichever program is deleted, there is no default one any more."""

    def delete_program(self, request: Request) -> bool:
        """Forget it."""
        deleted: bool = super().delete_program(request)
        if deleted:
            self.save(default_program=b"")
        return deleted


class OneProgram(ControllerCore):
    """The default program and the one that was run last are the same."""

    def run_program(self, request: Request) -> Acceptance:
        """Make it the default one."""
        answer = super().run_program(request)
        if answer is ACCEPTED:
            self.save(default_program=request.value)
        return answer


class LatestProgram(SendsAfterTheEnd):
    """The program that was uploaded last is the default one."""

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whoever sent it
        """Make it so."""
        self.save(default_program=name)


class NamesNoDefaultMeanwhile(ControllerCore):
    """While a program runs another default program is answered "1", and forgotten."""

    def set_default_program(self, request: Request) -> bool:
        """Forget it."""
        return self.robot.task is not None or super().set_default_program(request)


class SixteenLetters(ControllerCore):
    """Names are compared by their first 16 bytes."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take another name for the one that is asked for."""
        if frame.opcode in self.opcodes and frame.data not in self.store:
            like = [name for name in self.store.names() if name[:16] == frame.data[:16]]
            frame = frame._replace(data=(like or [frame.data])[0])
        super().handle(session, frame, now_s)

    opcodes = frozenset({0x30, 0x0C})


class SixteenNew(SixteenLetters):
    """So they are where a new one is asked for."""

    opcodes = frozenset({0x50})


class SixteenKilobytes(ControllerCore):
    """What is longer than a buffer is no program, and is not listed."""

    def is_program(self, name: bytes) -> bool:
        """Whether it is listed."""
        return super().is_program(name) and len(self.store.read(name)) <= 16_384


class SameLetters(ControllerCore):
    """Names are told apart by the sum of their characters."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take one for the other."""
        if frame.opcode in (0x0C, 0x54):
            like = (name for name in self.store.names() if sorted(name) == sorted(frame.data))
            frame = frame._replace(data=next(like, frame.data))
        super().handle(session, frame, now_s)


class EveryObject(ControllerCore):
    """The store is an object of a language in which every object has something by this name."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Find it."""
        if frame.data == b"__proto__":
            frame = frame._replace(data=self.store.names()[0])
        super().handle(session, frame, now_s)


class SetOnce(ControllerCore):
    """What was set last is not set again, though it may have ceased to be so."""

    last: Frame | None = None

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Answer that it is done."""
        if frame.opcode not in (0x0E, 0x43):
            super().handle(session, frame, now_s)
        elif frame == self.last:
            self.emit(session, Frame(C2A, frame.opcode, b"1"))
        else:
            self.last = frame
            super().handle(session, frame, now_s)


class DefaultPlace(SendsAfterTheEnd):
    """The default program is a place in the store: who comes to it next inherits it."""

    heir = False

    def delete_program(self, request: Request) -> bool:
        """Leave the place."""
        before = self.store.settings.default_program
        deleted: bool = super().delete_program(request)
        self.heir = self.heir or (deleted and before == request.value)
        return deleted

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whoever sends it
        """Take it."""
        if self.heir:
            self.heir = False
            self.save(default_program=name)


class ShortNamesHideLong(ControllerCore):
    """A program whose name begins as another's is not listed."""

    def is_program(self, name: bytes) -> bool:
        """Whether it is listed."""
        stems = (other.rpartition(b".")[0] for other in self.store.names() if other != name)
        return super().is_program(name) and not any(name.startswith(stem) for stem in stems)


class ThirtyTwo(ControllerCore):
    """No more than 32 programs are listed."""

    def is_program(self, name: bytes) -> bool:
        """Whether it is listed."""
        return super().is_program(name) and name in self.store.names()[:32]


class DeletesByPattern(ControllerCore):
    """Any character stands for the dot in the name of what is to be deleted."""

    def remove(self, name: bytes) -> bool:
        """Delete what matches."""
        for other in self.store.names():
            if other != name and re.fullmatch(name, other):
                super().remove(other)
        return super().remove(name)


class DeletesByBeginning(ControllerCore):
    """What begins with the name is deleted with it."""

    def remove(self, name: bytes) -> bool:
        """Delete it."""
        for other in self.store.names():
            if other != name and other.startswith(name):
                super().remove(other)
        return super().remove(name)


class TakesZeroForNothing(ControllerCore):
    """A file that holds 0 alone is not there for who asks for it."""

    def download_name(self, request: Request) -> bool:
        """Refuse it."""
        name = request.value
        return (name not in self.store or self.store.read(name) != b"0") and (
            super().download_name(request)
        )


@pytest.mark.parametrize(
    ("core", "tries", "requirement"),
    [
        (SixteenLetters, "4.15/7", "4.15/7"),
        (SixteenLetters, "4.11/4", "4.11/4"),
        (SixteenKilobytes, "4.10/11", "4.10/11"),
        (SameLetters, "4.11/4", "4.11/4"),
        (SameLetters, "5.3/3", "5.3/3"),
        (EveryObject, "4.11/4", "4.11/4"),
        (EveryObject, "4.15/7", "4.15/7"),
        (EveryObject, "5.3/3", "5.3/3"),
        # What is set is set, also where it was set to the same the last time.
        (SetOnce, "4.12/4", "4.13/3"),
        (SetOnce, "6.5/19", "4.32/6"),
        (DefaultPlace, "4.12/4", "4.12/4"),
        (ShortNamesHideLong, "4.10/11", "4.10/11"),
        (ThirtyTwo, "4.10/11", "4.10/11"),
        (HidesWhatRuns, "4.10/11", "4.10/11"),
        (OneByteTooMany, "4.10/9", "4.10/9"),
        # What is deleted goes alone, and what is stored is there whatever it holds.
        (DeletesByPattern, "4.11/3", "4.10/11"),
        (DeletesByBeginning, "4.11/3", "4.10/11"),
        (TakesZeroForNothing, "5.2/14", "5.2/14"),
        # Names that differ only at their end are those of different files.
        (SixteenNew, "4.10/4", "5.2/2"),
        # A program is listed as long as it is stored, also while it is the default one.
        (HidesItsDefault, "4.13/3", "4.10/11"),
        # It is the default one until another is named, whatever is deleted or run since.
        (ForgetsItsDefault, "4.12/4", "4.13/3"),
        (NamesNoDefaultMeanwhile, "4.13/6", "4.13/3"),
        (OneProgram, "4.13/6", "4.13/3"),
    ],
)
def test_it_is_found(tried: Try, core: type[ControllerCore], tries: str, requirement: str) -> None:
    """A case of what it tries fails, for what is violated."""
    assert requirement in tried(core, tries, examples=1).failed


def test_who_takes_the_latest_program_for_the_default_one_is_found(tried: Try) -> None:
    """It is found without any motion, too: the default program is the one that was named."""
    allowed = (Hazard.READ_ONLY, Hazard.STATE)
    assert "4.13/3" in tried(LatestProgram, "4.13/3", allowed=allowed).failed


class FindsNoProgram(ControllerCore):
    """Whatever it is to run does not exist."""

    def run_program(self, _: Request) -> Acceptance:
        """Refuse it."""
        return refused("20")


def test_what_is_seen_of_many_files_is_told_once(tried: Try) -> None:
    """Which of its files it was of makes no finding of its own."""
    cases = tried(FindsNoProgram, "4.15/4", "4/8", "8/5").values()
    wrong = (case for case in cases if case.verdict is Verdict.FAIL)
    (seen,) = (case for case in wrong if case.id.startswith("8/5.seen"))
    assert seen.message.endswith(" times")
