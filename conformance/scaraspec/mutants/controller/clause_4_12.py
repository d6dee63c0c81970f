"""Faults of clause 4.12: the default program as it is told."""

from abc import ABC, abstractmethod
from typing import Final

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.behaviour import SILENCE, Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

_OPCODES: Final = (0x0D, 0x13)


class _Tells(ControllerCore, ABC):
    """The default program is told otherwise."""

    @abstractmethod
    def told(self, name: bytes, request: Request) -> bytes:
        """What is told of a default program; its name is empty where there is none."""

    def get_default_program(self, request: Request) -> bytes | Silence:
        """Tell that."""
        name = super().get_default_program(request)
        return name if isinstance(name, Silence) else self.told(name, request)


@mutant("answers-with-the-other-opcode", "4.12/2")
class AnswersWithTheOtherOpcode(ControllerCore):
    """Asked with 0x0D the default program is told with the 0x13 of the frames."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Change it."""
        if frame.opcode in _OPCODES:
            frame = frame._replace(opcode=0x13)
        super().emit(session, frame)


@mutant("answers-with-the-headings-opcode", "4.12/2")
class AnswersWithTheHeadingsOpcode(ControllerCore):
    """Asked with 0x13 the default program is told with the 0x0D of the heading."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Change it."""
        if frame.opcode in _OPCODES:
            frame = frame._replace(opcode=0x0D)
        super().emit(session, frame)


@mutant("default-is-never-told", "4.12/5")
class DefaultIsNeverTold(ControllerCore):
    """Neither opcode is answered, whether there is a default program or not."""

    def get_default_program(self, request: Request) -> Silence:  # noqa: ARG002 - whoever asks
        """Stay silent."""
        return SILENCE


@mutant("default-is-path", "4.12/3")
class DefaultIsPath(_Tells):
    """The default program is told with its directory."""

    def told(self, name: bytes, request: Request) -> bytes:  # noqa: ARG002 - whoever asks
        """Add it."""
        return b"/programs/" + name if name else name


@mutant("default-is-the-first-program", "4.12/3")
class DefaultIsTheFirstProgram(_Tells):
    """The first program of the list is told to be the default one."""

    def told(self, name: bytes, request: Request) -> bytes:  # noqa: ARG002 - whoever asks
        """Look at the list."""
        return self.store.names()[0] if name else name


@mutant("default-with-flag", "4.12/3")
class DefaultWithFlag(_Tells):
    """The default program is told behind a flag."""

    def told(self, name: bytes, request: Request) -> bytes:  # noqa: ARG002 - whoever asks
        """Add it."""
        return b"1|" + name if name else name


@mutant("opcodes-tell-differently", "4.12/3")
class OpcodesTellDifferently(_Tells):
    """Asked with 0x13, nothing is told in place of the default program."""

    def told(self, name: bytes, request: Request) -> bytes:
        """Look at the opcode."""
        return b"" if request.frame.opcode == 0x13 else name


@mutant("no-default-is-the-word-null", "4.12/4")
class NoDefaultIsTheWordNull(_Tells):
    """Where there is no default program, the word NULL is told."""

    def told(self, name: bytes, request: Request) -> bytes:  # noqa: ARG002 - whoever asks
        """Say it."""
        return name or b"NULL"


@mutant("no-default-is-blank", "4.12/4")
class NoDefaultIsBlank(_Tells):
    """Where there is no default program, a blank is told."""

    def told(self, name: bytes, request: Request) -> bytes:  # noqa: ARG002 - whoever asks
        """Say it."""
        return name or b" "
