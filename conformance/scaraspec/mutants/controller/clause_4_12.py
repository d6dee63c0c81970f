"""Mutants of clause 4.12: the reported default program."""

from collections.abc import Callable
from typing import Final

from scaraspec.mutants.controller import Core, row
from scaraspec.mutants.operators.controller.replies import sent_frame
from scaraspec.mutants.operators.controller.requests import after, on_request
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_OPCODES: Final = (0x0D, 0x13)


def _name(change: Callable[[ControllerCore, Request, bytes], bytes]) -> Core:
    """The name of the default program is changed; it is empty if there is none."""
    return after(
        "get_default_program",
        lambda core, request, name: name if name is SILENCE else change(core, request, name),
    )


row(
    "answers-with-the-other-opcode",
    "4.12/2",
    "The reply to 0x0D has the opcode 0x13.",
    sent_frame(lambda frame: frame.opcode in _OPCODES, opcode=0x13),
)
row(
    "answers-with-the-headings-opcode",
    "4.12/2",
    "The reply to 0x13 has the opcode 0x0D.",
    sent_frame(lambda frame: frame.opcode in _OPCODES, opcode=0x0D),
)
row(
    "default-is-never-told",
    "4.12/5",
    "Neither 0x0D nor 0x13 is answered.",
    on_request("get_default_program", lambda _core, _request: SILENCE),
)
row(
    "default-is-path",
    "4.12/3",
    "The name of the default program includes a directory.",
    _name(lambda _core, _request, name: b"/programs/" + name if name else name),
)
row(
    "default-is-the-first-program",
    "4.12/3",
    "The first program of the list is reported as the default program.",
    _name(lambda core, _request, name: core.store.names()[0] if name else name),
)
row(
    "default-with-flag",
    "4.12/3",
    "A flag precedes the name of the default program.",
    _name(lambda _core, _request, name: b"1|" + name if name else name),
)
row(
    "opcodes-tell-differently",
    "4.12/3",
    "The reply to 0x13 has no data.",
    _name(lambda _core, request, name: b"" if request.frame.opcode == 0x13 else name),
)
row(
    "no-default-is-the-word-null",
    "4.12/4",
    "The reply without default program is the word NULL.",
    _name(lambda _core, _request, name: name or b"NULL"),
)
row(
    "no-default-is-blank",
    "4.12/4",
    "The reply without default program is a blank.",
    _name(lambda _core, _request, name: name or b" "),
)
