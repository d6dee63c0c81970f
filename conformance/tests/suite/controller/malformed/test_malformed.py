"""The malformed payloads of every command are malformed and differ from each other."""

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
REQUESTS = [command for command in COMMANDS if command.initiator is A2C]


def valid_value(command: Command) -> Any:
    """Return a valid value for the request of a command."""
    return VALUES.get(command.name, b"file.rob" if command.request.fields else None)


@pytest.mark.parametrize("command", REQUESTS, ids=lambda command: command.name)
def test_malformed_payloads_differ(command: Command) -> None:
    """Each payload fits a frame, differs from the valid payload and has a unique name."""
    payloads = malformed(command.name, valid_value(command))
    assert payloads
    assert len({f"{payload}" for payload in payloads}) == len(payloads)
    for payload in payloads:
        assert len(payload.data) <= 255
        assert payload.data != command.request.encode(valid_value(command))


@pytest.mark.parametrize("command", REQUESTS, ids=lambda command: command.name)
def test_firm_payloads_have_decode_issues(command: Command) -> None:
    """The codec reports an issue for each payload that no receiver may accept."""
    for payload in malformed(command.name, valid_value(command)):
        assert not payload.firm or command.request.decode(payload.data).issues, f"{payload}"
