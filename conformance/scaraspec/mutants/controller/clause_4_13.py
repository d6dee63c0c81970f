"""Mutants of clause 4.13: setting the default program."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import (
    after,
    answer,
    answer_when,
    decoded,
    executes_first,
)
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request


def _forgets(when: Callable[[ControllerCore, bytes], bool]) -> Core:
    """A new default program is answered 1 but not set, if the condition holds."""
    return answer_when(
        "set_default_program",
        lambda core, request: core.is_program(request.value) and when(core, request.value),
        value=True,
    )


def _starts(command: str) -> Core:
    """A new default program is started by another command."""

    def start(core: ControllerCore, request: Request, done: bool) -> bool:  # noqa: FBT001 - the answer
        getattr(core, command)(replace(request, command=BY_NAME[command]))
        return done

    return after("set_default_program", start)


def _clear_after_reset(core: ControllerCore, _request: Request, reply: Acceptance) -> Acceptance:
    if reply.accepted:
        core.save(default_program=b"")
    return reply


def _clear_if_malformed(core: ControllerCore, _frame: Frame, value: Any) -> Any:
    if value is None:
        core.save(default_program=b"")
    return value


row(
    "default-answered-in-words",
    "4.13/2",
    "A new default program is answered OK.",
    first_reply("set_default_program", {b"1": b"OK"}),
)
row(
    "new-default-answered-with-zero",
    "4.13/2",
    "A new default program is set but the answer is 0, as in the table row of the document.",
    answer("set_default_program", lambda _done: False),
)
row(
    "default-is-forgotten",
    "4.13/3",
    "A new default program is answered 1 but not set.",
    _forgets(lambda _core, _name: True),
)
row(
    "first-default-remains",
    "4.13/3",
    "If there is a default program, another one is answered 1 but not set.",
    _forgets(lambda core, _name: core.is_program(core.store.settings.default_program)),
    subtle=True,
)
row(
    "reset-forgets-the-default",
    "4.13/3",
    "A reset clears the default program.",
    after("reset", _clear_after_reset),
    subtle=True,
)
row(
    "long-default-is-forgotten",
    "4.13/3",
    "A default program with a name of thirty or more bytes is answered 1 but not set.",
    _forgets(lambda _core, name: len(name) >= 30),
    subtle=True,
)


@mutant("default-of-the-connection", "4.13/3", subtle=True)
class HidesDefaultFromOtherConnections(ControllerCore):
    """Only the connection that set the default program can read it."""

    _set_by = -1

    def set_default_program(self, request: Request) -> bool:
        self._set_by = request.session.connection
        return super().set_default_program(request)

    def get_default_program(self, request: Request) -> Any:
        is_own = request.session.connection == self._set_by
        return super().get_default_program(request) if is_own else b""


row(
    "refusal-clears-the-default",
    "4.13/5",
    "A missing program is refused, and the default program is cleared.",
    after(
        "set_default_program",
        lambda core, _request, done: done or not core.save(default_program=b""),
    ),
    subtle=True,
)
row(
    "malformed-name-clears-the-default",
    "4.13/5",
    "A malformed name is refused, and the default program is cleared.",
    decoded("set_default_program", _clear_if_malformed),
    subtle=True,
)
row(
    "default-is-started",
    "4.13/6",
    "A new default program is started at once.",
    _starts("run_program"),
)
row(
    "default-is-tried-out",
    "4.13/6",
    "A new default program is simulated at once.",
    _starts("simulate_program"),
)

row(
    "two-defaults-per-connection",
    "4.13/3",
    "Only the first two default programs of a connection are stored; later ones are answered 1.",
    executes_first("set_default_program", 2),
    subtle=True,
)
