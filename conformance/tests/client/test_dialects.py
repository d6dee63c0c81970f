"""The client with the virtual controller in every dialect, in one process and simulated time."""

from datetime import datetime

import pytest

from scaraspec.client import Client, Interrupted, State
from scaraspec.protocol.program_files import Node, NodeType, Program, WaitSeconds, build
from scaraspec.protocol.readings import READINGS, Dialect
from scaraspec.transports.memory import MemoryNetwork
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.store import Store

CONTENT = build(Program(nodes=(Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(60)),)))
CHOICES = [(key, option.name) for key, reading in READINGS.items() for option in reading.options]

# Readings that the session below shows in every dialect.
SEEN = {
    "chunk_trunc",
    "endian",
    "estop_interrupted",
    "list_cont",
    "list_empty",
    "list_prefix_sep",
    "op_get_default",
    "op_temp_reply",
    "runinfo_none",
}

# A controller with this reading accepts nothing else, so that the client must use it.
USED_BY_CLIENT = {("jog_byte", "binary")}


@pytest.mark.parametrize(("key", "option"), CHOICES, ids=map("=".join, CHOICES))
def test_a_session_works_in_every_dialect(key: str, option: str) -> None:
    """The client accepts every tolerated reading and detects it."""
    dialect = Dialect.of(**{key: option})
    plant = Plant(datetime(2014, 12, 22), now_s=0.0)  # noqa: DTZ001 - the document names no zone
    network = MemoryNetwork(ControllerCore(plant, Store(), dialect))
    extension = ".txt" if option == ".txt" else ".rob"
    names = tuple(f"program-{number:02}-of-30-bytes..{extension}" for number in range(20))
    client_dialect = dialect if (key, option) in USED_BY_CLIENT else Dialect.of()
    with Client(network.connect(), password="password", dialect=client_dialect) as client:
        assert client.list_programs() == ()
        for name in names:
            client.upload_bytes(CONTENT, name)
        assert client.list_programs() == names
        assert client.download_bytes(names[3]) == CONTENT
        client.set_default_program(names[0])
        assert client.get_default_program() == names[0]
        assert client.get_running_program() is None
        assert client.get_motor_temperatures() == (25, 25, 25, 25)
        client.set_gripper_center(1, -2.5, 0)
        assert client.get_gripper_center() == (1, -2.5, 0)
        client.run_program(names[1])
        pending = client.start_run_program(names[2])
        assert client.get_status().state is State.RUNNING
        running = client.get_running_program()
        assert running is not None
        assert running.name == names[2]
        client.emergency_stop()
        with pytest.raises(Interrupted):
            pending.wait(60)
        client.jog("-y")
        assert client.get_status().state is State.IDLE
        observed = client.observed_readings
    assert observed.keys() >= SEEN
    if key in observed and option != "both":  # the option that was used of the two is detected
        assert observed[key] == {option}
