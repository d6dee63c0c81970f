"""The malformed payloads of the suite are malformed, each in its own way, for every command."""

from datetime import datetime
from typing import Any

import pytest

from scaraspec.protocol.commands import (
    COMMANDS,
    Command,
    MoveTarget,
    Network,
    PasswordChange,
    Point,
    PortValue,
    Pose,
)
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.payloads import JogDirection
from scaraspec.protocol.transfer import Chunk
from scaraspec.suite.controller.harness.malformed.payloads import malformed

VALUES: dict[str, Any] = {
    "login": b"password",
    "set_password": PasswordChange(b"old", b"new"),
    "set_network": Network("192.168.1.2", "255.255.255.0", "192.168.1.1"),
    "set_time": datetime(2024, 6, 15, 12),  # noqa: DTZ001 - the document names no zone
    "set_gripper_center": Point(1, -2.5, 3),
    "set_initial_tool_position": Pose(1, 2, 3, 4, 5, 6),
    "set_tool_coordinates": MoveTarget(10, 1, 2, 3, 4, 5, 6),
    "jog": JogDirection.PLUS_X,
    "set_digital_output": PortValue(1, 1),
    "get_analog_input": 1,
    "upload_chunk": Chunk(1, 0, 1, b"!"),
}
ASKED = [command for command in COMMANDS if command.initiator is A2C]


def value_of(command: Command) -> Any:
    """A valid value of a command's request."""
    return VALUES.get(command.name, b"file.rob" if command.request.fields else None)


@pytest.mark.parametrize("command", ASKED, ids=lambda command: command.name)
def test_every_command_has_malformed_payloads_of_different_kinds(command: Command) -> None:
    """Each fits a frame, differs from the valid payload and bears a name of its own."""
    made = malformed(command.name, value_of(command))
    assert made
    assert len({f"{each}" for each in made}) == len(made)
    for each in made:
        assert len(each.data) <= 255
        assert each.data != command.request.encode(value_of(command))


@pytest.mark.parametrize("command", ASKED, ids=lambda command: command.name)
def test_what_is_firmly_malformed_is_complained_of(command: Command) -> None:
    """The codec complains of each that no receiver may act upon."""
    for each in malformed(command.name, value_of(command)):
        assert not each.firm or command.request.decode(each.data).issues, f"{each}"
