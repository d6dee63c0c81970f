"""Operators that change how a command is executed, read or answered.

`command` is the name of a row of the command table. A change receives the core, the request and
the answer that the conforming controller gives.
"""

from collections import Counter
from collections.abc import Callable
from typing import Any

from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import DONE
from scaraspec.virtual_controller.session import Request

Condition = Callable[[ControllerCore, Request], bool]
Core = type[ControllerCore]


def on_request(command: str, execute: Callable[[ControllerCore, Request], Any]) -> Core:
    """`execute` executes the command and returns the answer, in place of the controller."""
    return type("OnRequest", (ControllerCore,), {command: execute})


def answer(command: str, change: Callable[[Any], Any]) -> Core:
    """The command is executed; its answer is changed."""

    def execute(core: ControllerCore, request: Request) -> Any:
        return change(getattr(super(changed, core), command)(request))

    changed = on_request(command, execute)
    return changed


def answer_when(command: str, when: Condition, value: Any) -> Core:
    """The command is not executed but answered with `value`, if the condition holds."""

    def execute(core: ControllerCore, request: Request) -> Any:
        return value if when(core, request) else getattr(super(changed, core), command)(request)

    changed = on_request(command, execute)
    return changed


def accepts(command: str, when: Condition) -> Core:
    """A two-stage command is accepted but not executed, if the condition holds."""
    return answer_when(command, when, ACCEPTED)


def refuses(command: str, when: Condition, code: str) -> Core:
    """A two-stage command is refused with a code, if the condition holds."""
    return answer_when(command, when, refused(code))


def ignores(command: str, when: Condition) -> Core:
    """A request is neither executed nor answered, if the condition holds."""
    return answer_when(command, when, SILENCE)


def executes_first(command: str, count: int) -> Core:
    """Only the first `count` requests of a connection are executed; all are answered 1."""

    class ExecutesFirst(ControllerCore):
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            self.counts = Counter[int]()

    def execute(core: ExecutesFirst, request: Request) -> Any:
        core.counts[request.session.connection] += 1
        if core.counts[request.session.connection] > count:
            return True
        return getattr(super(ExecutesFirst, core), command)(request)

    return type("ExecutesFirst", (ExecutesFirst,), {command: execute})


def completes(command: str, when: Condition) -> Core:
    """A two-stage command is reported as done but not executed, if the condition holds."""

    def execute(core: ControllerCore, request: Request) -> Any:
        if when(core, request):
            core.send_result(request, DONE)
            return ACCEPTED
        return getattr(super(changed, core), command)(request)

    changed = on_request(command, execute)
    return changed


def completes_refused(command: str, code: str) -> Core:
    """A two-stage command that the robot refuses with this code is reported as done."""

    def complete(core: ControllerCore, request: Request, reply: Any) -> Any:
        if reply.code != code:
            return reply
        core.send_result(request, DONE)
        return ACCEPTED

    return after(command, complete)


def reads(command: str, change: Callable[[bytes], bytes]) -> Core:
    """The data of requests of one command are changed before they are decoded."""

    class Reads(ControllerCore):
        def _value(self, received: Command, frame: Frame) -> Any:
            if received.name == command:
                frame = frame._replace(data=change(frame.data))
            return super()._value(received, frame)

    return Reads


def busy(core: ControllerCore, _request: Request) -> bool:
    """The robot executes a command."""
    return core.robot.task is not None


def executing(*commands: str) -> Condition:
    """The robot executes one of these commands."""
    return lambda core, _request: (
        core.robot.task is not None and core.robot.task.request.command.name in commands
    )


def after(command: str, act: Callable[[ControllerCore, Request, Any], Any]) -> Core:
    """The command is executed; `act` receives its answer and returns what is sent instead."""

    def execute(core: ControllerCore, request: Request) -> Any:
        return act(core, request, getattr(super(changed, core), command)(request))

    changed = on_request(command, execute)
    return changed


def decoded(command: str, change: Callable[[ControllerCore, Frame, Any], Any]) -> Core:
    """The value of requests is changed after they are decoded; it is None for wrong data."""

    class Decoded(ControllerCore):
        def _value(self, received: Command, frame: Frame) -> Any:
            value = super()._value(received, frame)
            return change(self, frame, value) if received.name == command else value

    return Decoded


def before(command: str, act: Callable[[ControllerCore, Request], Any]) -> Core:
    """`act` is called before the command is executed."""

    def execute(core: ControllerCore, request: Request) -> Any:
        act(core, request)
        return getattr(super(changed, core), command)(request)

    changed = on_request(command, execute)
    return changed
