"""Faults of clause 4.13: setting the default program."""

from dataclasses import replace
from typing import Any, Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies
from scaraspec.protocol.commands import BY_NAME, Command
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_SET_DEFAULT: Final = 0x0E


@mutant("default-answered-in-words", "4.13/2")
class DefaultAnsweredInWords(AltersReplies):
    """A new default program is answered with a word."""

    opcode = _SET_DEFAULT

    def altered(self, data: bytes) -> bytes:
        """Say it in words."""
        return b"OK" if data == b"1" else data


@mutant("new-default-answered-with-zero", "4.13/2")
class NewDefaultAnsweredWithZero(ControllerCore):
    """A new default program is set, and the answer is the 0 of the document's row."""

    def set_default_program(self, request: Request) -> bool:
        """Set it, and say the contrary."""
        super().set_default_program(request)
        return False


@mutant("default-is-forgotten", "4.13/3")
class DefaultIsForgotten(ControllerCore):
    """A new default program is answered 1 and not set."""

    def set_default_program(self, request: Request) -> bool:
        """Only look for it."""
        return self.is_program(request.value)


@mutant("first-default-remains", "4.13/3", subtle=True)
class FirstDefaultRemains(ControllerCore):
    """Once there is a default program, another one is answered 1 and not set."""

    def set_default_program(self, request: Request) -> bool:
        """Set the first one."""
        if self.is_program(self.store.settings.default_program):
            return self.is_program(request.value)
        return super().set_default_program(request)


@mutant("reset-forgets-the-default", "4.13/3", subtle=True)
class ResetForgetsTheDefault(ControllerCore):
    """A reset leaves no default program."""

    def reset(self, request: Request) -> Acceptance:
        """Forget it."""
        answer: Acceptance = super().reset(request)
        if answer.accepted:
            self.save(default_program=b"")
        return answer


@mutant("long-default-is-forgotten", "4.13/3", subtle=True)
class LongDefaultIsForgotten(ControllerCore):
    """A default program with a name of thirty bytes is answered 1 and not set."""

    def set_default_program(self, request: Request) -> bool:
        """Set shorter ones."""
        if len(request.value) < 30:
            return super().set_default_program(request)
        return self.is_program(request.value)


@mutant("default-of-the-connection", "4.13/3", subtle=True)
class DefaultOfTheConnection(ControllerCore):
    """A default program is one for the connection that has set it."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._set_by = -1

    def set_default_program(self, request: Request) -> bool:
        """Remember who it was."""
        self._set_by = request.session.connection
        return super().set_default_program(request)

    def get_default_program(self, request: Request) -> Any:
        """Tell nobody else."""
        own = request.session.connection == self._set_by
        return super().get_default_program(request) if own else b""


@mutant("refusal-clears-the-default", "4.13/5", subtle=True)
class RefusalClearsTheDefault(ControllerCore):
    """A program that is not stored is refused, and then there is no default program any more."""

    def set_default_program(self, request: Request) -> bool:
        """Clear it first."""
        return super().set_default_program(request) or not self.save(default_program=b"")


@mutant("malformed-name-clears-the-default", "4.13/5", subtle=True)
class MalformedNameClearsTheDefault(ControllerCore):
    """A name that is none is refused, and then there is no default program any more."""

    def _value(self, command: Command, frame: Frame) -> Any:
        value = super()._value(command, frame)
        if command.name == "set_default_program" and value is None:
            self.save(default_program=b"")
        return value


@mutant("default-is-started", "4.13/6")
class DefaultIsStarted(ControllerCore):
    """A new default program is started at once."""

    def set_default_program(self, request: Request) -> bool:
        """Start it."""
        answer = super().set_default_program(request)
        self.run_program(replace(request, command=BY_NAME["run_program"]))
        return answer


@mutant("default-is-tried-out", "4.13/6")
class DefaultIsTriedOut(ControllerCore):
    """A new default program is simulated at once, to see whether it can run."""

    def set_default_program(self, request: Request) -> bool:
        """Simulate it."""
        answer = super().set_default_program(request)
        self.simulate_program(replace(request, command=BY_NAME["simulate_program"]))
        return answer
