"""The command table and the core: one method per command, one input and one output method."""

from typing import Any

import pytest

from scaraspec.protocol.commands import COMMANDS, Command
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import NoData
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Session

_WITHOUT_DATA = [row.name for row in COMMANDS if isinstance(row.request, NoData)]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_every_row_of_the_table_has_a_method(command: Command) -> None:
    """A command in the table without a method of its name fails here."""
    assert callable(getattr(ControllerCore, command.name, None))


@pytest.mark.parametrize("name", _WITHOUT_DATA)
def test_every_query_without_data_is_answered(bench: Any, name: str) -> None:
    """Requirement 3/31: a valid query gets a reply with its opcode."""
    client = bench.client()
    client.send(name)
    assert client.receive()[0][0] == name


@pytest.mark.parametrize("name", _WITHOUT_DATA)
def test_data_on_a_request_that_has_none_is_ignored(bench: Any, name: str) -> None:
    """A-3-12: the reply is the one without the data."""
    client = bench.client()
    client.send(name, b"0")
    assert client.receive()[0][0] == name


def test_every_frame_passes_handle_and_emit(bench: Any) -> None:
    """A subclass that overrides `handle` and `emit` can change every frame."""

    class Spoils(ControllerCore):
        seen: list[str] = []  # noqa: RUF012 - one core of this class is made, here

        def handle(self, session: Session, frame: Frame, now_s: float) -> None:
            self.seen.append(f"in {frame.opcode:02X}")
            super().handle(session, frame, now_s)

        def emit(self, session: Session, frame: Frame) -> None:
            self.seen.append(f"out {frame.opcode:02X}")
            super().emit(session, frame._replace(data=b"spoilt"))

    core = Spoils(bench.plant, bench.store)
    core.open(1, 0.0)
    core.receive(1, b"\xaa\x01\x08password\xcc", 0.0)
    (sent,) = core.receive(1, b"\xaa\x09\x00\xcc", 0.0)
    assert sent.data == b"\xcc\x09\x06spoilt\xaa"
    assert Spoils.seen == ["in 01", "out 01", "in 09", "out 09"]


def test_a_behaviour_can_be_replaced_by_its_name(bench: Any) -> None:
    """A faulty controller is a subclass that overrides the method of one command."""

    class WrongStatus(ControllerCore):
        def get_status(self, _: object) -> str:
            return "04"

    core = WrongStatus(bench.plant, bench.store)
    core.open(1, 0.0, "serial")
    (sent,) = core.receive(1, b"\xaa\x09\x00\xcc", 0.0)
    assert sent.data == b"\xcc\x09\x0204\xaa"
