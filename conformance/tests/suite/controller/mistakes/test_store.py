"""Faulty controllers: file names, the program list and the default program.

For each fault, a case of the violated requirement must fail.
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

RunCases = Callable[..., Any]


class SendsListPartOf256Bytes(ControllerCore):
    """A part of the list may have 256 bytes; its length byte is then 0."""

    def list_programs(self, request: Request) -> NameListPart | Silence:
        data = b"|".join((b"0", *self.store.names()))
        if len(data) != 256:
            return super().list_programs(request)
        self.transmit(request.session, b"\xcc\x0b\x00" + data + b"\xaa")
        return SILENCE


class HidesRunningProgram(ControllerCore):
    """The running program is not in the list."""

    def is_program(self, name: bytes) -> bool:
        task = self.robot.task
        return super().is_program(name) and (task is None or task.program != name)


class HidesDefaultProgram(ControllerCore):
    """The default program is not in the list."""

    def list_programs(self, request: Request) -> NameListPart:
        part = super().list_programs(request)
        hidden = self.store.settings.default_program
        return part._replace(names=tuple(name for name in part.names if name != hidden))


class ForgetsDefaultAtDeletion(ControllerCore):
    """The deletion of any program removes the default program."""

    def delete_program(self, request: Request) -> bool:
        deleted: bool = super().delete_program(request)
        if deleted:
            self.save(default_program=b"")
        return deleted


class RunSetsDefault(ControllerCore):
    """A program that is run becomes the default program."""

    def run_program(self, request: Request) -> Acceptance:
        reply = super().run_program(request)
        if reply is ACCEPTED:
            self.save(default_program=request.value)
        return reply


class UploadSetsDefault(SendsAfterTheEnd):
    """A program that is uploaded becomes the default program."""

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - unused
        self.save(default_program=name)


class IgnoresDefaultDuringRun(ControllerCore):
    """While a program runs, setting the default program is answered "1" and has no effect."""

    def set_default_program(self, request: Request) -> bool:
        return self.robot.task is not None or super().set_default_program(request)


class Compares16Bytes(ControllerCore):
    """Names are compared by their first 16 bytes."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode in self.opcodes and frame.data not in self.store:
            similar = [name for name in self.store.names() if name[:16] == frame.data[:16]]
            frame = frame._replace(data=(similar or [frame.data])[0])
        super().handle(session, frame, now_s)

    opcodes = frozenset({0x30, 0x0C})


class Compares16BytesOfNewNames(Compares16Bytes):
    """A new name is compared by its first 16 bytes."""

    opcodes = frozenset({0x50})


class ListsUpTo16Kilobytes(ControllerCore):
    """A file that is longer than 16 kilobytes is not listed as a program."""

    def is_program(self, name: bytes) -> bool:
        return super().is_program(name) and len(self.store.read(name)) <= 16_384


class IgnoresLetterOrder(ControllerCore):
    """Names with the same letters in another order are not distinguished."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode in (0x0C, 0x54):
            similar = (name for name in self.store.names() if sorted(name) == sorted(frame.data))
            frame = frame._replace(data=next(similar, frame.data))
        super().handle(session, frame, now_s)


class FindsInheritedName(ControllerCore):
    """The store is an object of a language in which every object has an attribute of this name."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.data == b"__proto__":
            frame = frame._replace(data=self.store.names()[0])
        super().handle(session, frame, now_s)


class IgnoresRepeatedSetting(ControllerCore):
    """A setting that repeats the last one is answered 1 and ignored, even if it changed since."""

    last: Frame | None = None

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode not in (0x0E, 0x43):
            super().handle(session, frame, now_s)
        elif frame == self.last:
            self.emit(session, Frame(C2A, frame.opcode, b"1"))
        else:
            self.last = frame
            super().handle(session, frame, now_s)


class NextUploadBecomesDefault(SendsAfterTheEnd):
    """The default program is a slot of the store, which the next upload after a deletion takes."""

    slot_is_free = False

    def delete_program(self, request: Request) -> bool:
        before = self.store.settings.default_program
        deleted: bool = super().delete_program(request)
        self.slot_is_free = self.slot_is_free or (deleted and before == request.value)
        return deleted

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - unused
        if self.slot_is_free:
            self.slot_is_free = False
            self.save(default_program=name)


class HidesNamesWithSamePrefix(ControllerCore):
    """A program whose name begins with the name of another one is not listed."""

    def is_program(self, name: bytes) -> bool:
        stems = (other.rpartition(b".")[0] for other in self.store.names() if other != name)
        return super().is_program(name) and not any(name.startswith(stem) for stem in stems)


class Lists32Programs(ControllerCore):
    """At most 32 programs are listed."""

    def is_program(self, name: bytes) -> bool:
        return super().is_program(name) and name in self.store.names()[:32]


class DeletesByPattern(ControllerCore):
    """The name of a deletion is used as a pattern, in which a dot matches any character."""

    def remove(self, name: bytes) -> bool:
        for other in self.store.names():
            if other != name and re.fullmatch(name, other):
                super().remove(other)
        return super().remove(name)


class DeletesByPrefix(ControllerCore):
    """A deletion also deletes the files whose names begin with the name."""

    def remove(self, name: bytes) -> bool:
        for other in self.store.names():
            if other != name and other.startswith(name):
                super().remove(other)
        return super().remove(name)


class HidesFileOfZero(ControllerCore):
    """A file whose only content is the character 0 cannot be downloaded."""

    def download_name(self, request: Request) -> bool:
        name = request.value
        return (name not in self.store or self.store.read(name) != b"0") and (
            super().download_name(request)
        )


@pytest.mark.parametrize(
    ("core", "only", "requirement"),
    [
        (Compares16Bytes, "4.15/7", "4.15/7"),
        (Compares16Bytes, "4.11/4", "4.11/4"),
        (ListsUpTo16Kilobytes, "4.10/11", "4.10/11"),
        (IgnoresLetterOrder, "4.11/4", "4.11/4"),
        (IgnoresLetterOrder, "5.3/3", "5.3/3"),
        (FindsInheritedName, "4.11/4", "4.11/4"),
        (FindsInheritedName, "4.15/7", "4.15/7"),
        (FindsInheritedName, "5.3/3", "5.3/3"),
        # A setting takes effect even if it repeats the last one.
        (IgnoresRepeatedSetting, "4.12/4", "4.13/3"),
        (IgnoresRepeatedSetting, "6.5/19", "4.32/6"),
        (NextUploadBecomesDefault, "4.12/4", "4.12/4"),
        (HidesNamesWithSamePrefix, "4.10/11", "4.10/11"),
        (Lists32Programs, "4.10/11", "4.10/11"),
        (HidesRunningProgram, "4.10/11", "4.10/11"),
        (SendsListPartOf256Bytes, "4.10/9", "4.10/9"),
        # A deletion deletes only the named file, and a stored file exists whatever its content is.
        (DeletesByPattern, "4.11/3", "4.10/11"),
        (DeletesByPrefix, "4.11/3", "4.10/11"),
        (HidesFileOfZero, "5.2/14", "5.2/14"),
        # Names that differ only at their end belong to different files.
        (Compares16BytesOfNewNames, "4.10/4", "5.2/2"),
        # A stored program is listed, also while it is the default program.
        (HidesDefaultProgram, "4.13/3", "4.10/11"),
        # The default program stays until another one is set, whatever is deleted or run.
        (ForgetsDefaultAtDeletion, "4.12/4", "4.13/3"),
        (IgnoresDefaultDuringRun, "4.13/6", "4.13/3"),
        (RunSetsDefault, "4.13/6", "4.13/3"),
    ],
)
def test_fault_is_detected(
    run_cases: RunCases, core: type[ControllerCore], only: str, requirement: str
) -> None:
    """One of the cases that run fails for the violated requirement."""
    assert requirement in run_cases(core, only, examples=1, fail_fast=True).violated


def test_upload_as_default_is_detected_without_motion(run_cases: RunCases) -> None:
    """A case that needs no motion detects that an upload changes the default program."""
    allowed = (Hazard.READ_ONLY, Hazard.STATE)
    assert "4.13/3" in run_cases(UploadSetsDefault, "4.13/3", allowed=allowed).violated


class FindsNoProgram(ControllerCore):
    """Every program is refused as missing."""

    def run_program(self, _: Request) -> Acceptance:
        return refused("20")


def test_observations_of_many_files_are_one_finding(run_cases: RunCases) -> None:
    """The judge reports the same violation for different files as one finding."""
    cases = run_cases(FindsNoProgram, "4.15/4", "4/8", "8/5").values()
    failed = (case for case in cases if case.verdict is Verdict.FAIL)
    (seen,) = (case for case in failed if case.id.startswith("8/5.seen"))
    assert seen.message.endswith(" times")
