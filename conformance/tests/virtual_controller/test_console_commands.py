"""Console commands: their effect on the plant, and the errors for invalid lines."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scaraspec.virtual_controller.console_commands import HELP, ConsoleCommandError, execute
from scaraspec.virtual_controller.plant import Plant


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("motor-fault inner_arm", "11"),
        ("motor-fault inner_arm,wrist", "15"),
        ("motor-fault inner_arm,outer_arm,wrist,rotation", "1F"),
        ("  position-fault  ", "05"),
        ("angle-fault", "06"),
    ],
)
def test_faults_are_injected_and_cleared(plant: Plant, line: str, code: str) -> None:
    """Each fault code of table 8-1 can be injected."""
    assert execute(line, plant, 1.0) == f"status {code}"
    assert plant.fault_code == code
    assert execute("clear", plant, 1.0) == "all faults are removed"
    assert plant.fault_code is None


@pytest.mark.parametrize("line", ["motor-fault wrist lasting", "angle-fault lasting"])
def test_a_lasting_fault_survives_a_reset_until_repaired(plant: Plant, line: str) -> None:
    """A reset calls `clear_faults`, which keeps a fault whose cause lasts."""
    execute(line, plant, 0.0)
    plant.clear_faults()
    assert plant.fault_code is not None
    execute("repair", plant, 0.0)
    assert plant.fault_code is not None
    plant.clear_faults()
    assert plant.fault_code is None


def test_disk_and_inputs_are_set(plant: Plant) -> None:
    """Ports are numbered from 1."""
    assert execute("disk-full on", plant, 0.0) == "the disk is full"
    assert plant.disk_full
    assert execute("disk-full off", plant, 0.0) == "the disk has room"
    assert not plant.disk_full
    assert execute("input 3 1", plant, 0.0) == "digital input 3 is 1"
    assert plant.digital_inputs[3]
    execute("input 3 0", plant, 0.0)
    assert not plant.digital_inputs[3]
    assert execute("analog 2 4.75", plant, 0.0) == "analog input 2 is 4.75"
    assert plant.analog_inputs[2] == 4.75


def test_help_names_every_command(plant: Plant) -> None:
    """Help lists exactly the existing commands; an empty line prints nothing."""
    assert execute("help", plant, 0.0) == HELP
    for row in HELP.splitlines():
        with pytest.raises(ConsoleCommandError) as printed:
            execute(f"{row.split()[0]} one two three", plant, 0.0)
        assert "there is no command" not in str(printed.value)
    assert execute("  ", plant, 0.0) == ""


@pytest.mark.parametrize(
    ("line", "reported"),
    [
        ("explode", "there is no command 'explode': the commands are motor-fault,"),
        ("motor-fault", "takes joints separated by commas: inner_arm,"),
        ("motor-fault elbow", "there is no joint 'elbow': the joints are inner_arm,"),
        ("motor-fault wrist,", "there is no joint ''"),
        ("position-fault now", "a fault takes no argument 'now'"),
        ("clear all", "takes no argument, but 'all' was given"),
        ("disk-full", "takes on or off"),
        ("disk-full maybe", "takes on or off"),
        ("input 3", "takes a port, 1 to 8, and 0 or 1"),
        ("input 3 2", "a digital input must be 0 or 1, not '2'"),
        ("input 9 1", "there is no digital input 9: the ports are 1 to 8"),
        ("input x 1", "takes a port"),
        ("analog 2 much", "'much' is not a valid analog value"),
        ("analog 2 nan", "'nan' is not a valid analog value"),
        ("analog 0 1", "there is no analog input 0"),
    ],
)
def test_invalid_line_raises_an_error(plant: Plant, line: str, reported: str) -> None:
    """The message states the mistake and the valid forms."""
    with pytest.raises(ConsoleCommandError) as printed:
        execute(line, plant, 0.0)
    assert reported in str(printed.value)
    assert "\n" not in str(printed.value)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    line=st.text(max_size=50)
    | st.lists(st.sampled_from(["input", "analog", "motor-fault", "wrist", "3", "1e9"])).map(
        " ".join
    )
)
def test_any_line_is_executed_or_raises_an_error(plant: Plant, line: str) -> None:
    """No input raises another exception."""
    try:
        printed = execute(line, plant, 0.0)
    except ConsoleCommandError as error:
        printed = str(error)
    assert len(printed) < 250 or printed == HELP
