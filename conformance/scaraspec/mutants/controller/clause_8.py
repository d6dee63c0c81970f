"""Mutants of clause 8: the codes of table 8-1."""

from collections.abc import Callable

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import answer
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller.behaviour.base import refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session


def _codes(change: Callable[[bytes], bytes], *, in_refusals: bool = True) -> Core:
    """The codes of refusals and of failed final results are changed."""

    class Codes(ControllerCore):
        def emit(self, session: Session, frame: Frame) -> None:
            head, bar, code = frame.data.partition(b"|")
            has_code = head in (b"0", b"00") and bar and len(code) == 2
            if has_code and (in_refusals or frame.tagged):
                frame = frame._replace(data=head + bar + change(code))
            super().emit(session, frame)

    return Codes


def _replace(old: bytes, new: bytes) -> Core:
    return _codes(lambda code: new if code == old else code)


def _decimal(code: bytes) -> bytes:
    return b"%02d" % int(code, 16)


row(
    "codes-as-numbers",
    "8/1",
    "The code of a refusal is a number in one byte.",
    _codes(lambda code: bytes((int(code) if code.isdigit() else int(code, 16),))),
)
row(
    "status-as-number",
    "8/1",
    "The status is two bytes, each a number.",
    first_reply("get_status", lambda data: bytes(int(digit, 16) for digit in data.decode())),
)
row(
    "codes-in-decimal",
    "8/2",
    "The codes from 0x10 on are written in decimal.",
    _codes(_decimal),
)
row(
    "status-in-decimal",
    "8/2 8/4",
    "The status of motors with a fault is written in decimal.",
    first_reply("get_status", _decimal),
)
row(
    "failures-in-decimal",
    "8/2",
    "The codes of final results are written in decimal.",
    _codes(_decimal, in_refusals=False),
)
row(
    "busy-code-of-its-own",
    "8/2",
    "A robot that runs a program refuses others with the code 30, which no table has.",
    _replace(b"01", b"30"),
)
row(
    "reserved-while-busy",
    "8/3 4/15",
    "A robot that runs a program refuses others with the reserved code 07.",
    _replace(b"01", b"07"),
)
row(
    "missing-is-bad-argument",
    "8/5",
    "A missing program is refused with the code 05.",
    _replace(b"20", b"05"),
)
row(
    "missing-simulation-is-an-angle",
    "8/5",
    "The simulation of a missing program is refused with the code 06.",
    answer("simulate_program", lambda reply: refused("06") if reply.code == "20" else reply),
)


@mutant("runs-what-was-deleted", "8/5", subtle=True)
class RunsDeletedProgram(ControllerCore):
    """The program that ran last stays in memory: it runs again although it was deleted."""

    _last: tuple[bytes, bytes] = (b"", b"")

    def run_program(self, request: Request) -> Acceptance:
        name, store = request.value, self.store
        if name in store:
            self._last = name, store.read(name)
        elif self._last[0] == name:
            store.write(*self._last)
            reply = super().run_program(request)
            store.delete(name)
            return reply
        return super().run_program(request)
