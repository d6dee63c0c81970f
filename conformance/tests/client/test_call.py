"""`scaraspec call` with `scaraspec controller`."""

import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from scaraspec.cli.main import group
from scaraspec.cli.problems import Problem
from scaraspec.client import Pending
from scaraspec.client.text_interface import OPERATIONS
from scaraspec.protocol.program_files import Node, NodeType, Program, WaitSeconds, build

SCARASPEC = str(Path(sys.executable).with_name("scaraspec"))
ENDS_WITHIN_S = 30


def program_of(duration_s: int) -> bytes:
    """Return a program that waits for this time."""
    return build(Program(nodes=(Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(duration_s)),)))


def call(url: str, *arguments: str) -> tuple[int, str]:
    """Return the exit status, and standard output or the error sentence."""
    result = CliRunner().invoke(group, ["call", url, *arguments])
    if isinstance(result.exception, Problem):
        return int(result.exception.exit_status), str(result.exception)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.output
    return result.exit_code, result.stdout.rstrip("\n")


@pytest.fixture
def controller() -> Iterator[str]:
    """The URL of a virtual controller with 20-fold time scale."""
    arguments = ["--listen", "127.0.0.1:0", "--time-scale", "20"]
    with subprocess.Popen(
        [SCARASPEC, "controller", *arguments], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        reported = process.stdout.readline()
        assert reported.startswith("listening on tcp://")
        try:
            yield reported.split()[-1]
        finally:
            process.terminate()
            process.wait(ENDS_WITHIN_S)


NETWORK = {"ip": "10.0.0.1", "mask": "255.0.0.0", "gateway": "10.0.0.2"}
POSE = {"x": 200, "y": 300, "z": 324, "theta_x": 34.6, "theta_y": 34.5, "theta_z": 0}

# Every operation of the table in a useful order, with the reply of the controller; Ellipsis means
# any reply.
SESSION: list[tuple[list[str], Any]] = [
    (["login", "password"], None),
    (["get_version"], ...),
    (["get_status"], {"state": "idle", "code": "00", "meaning": "idle", "joints": []}),
    (["set_time", "20141222143000"], None),
    (["get_time"], ...),
    (["set_network", *NETWORK.values()], None),
    (["get_network"], NETWORK),
    (["list_programs"], []),
    (["upload", "a.rob"], None),
    (["upload", "a.rob", "程序.rob"], None),
    (["list_programs"], ["a.rob", "程序.rob"]),
    (["delete_program", "程序.rob"], None),
    (["download", "a.rob", "b.rob"], "b.rob"),
    (["set_default_program", "a.rob"], None),
    (["get_default_program"], "a.rob"),
    (["run_program", "a.rob"], None),
    (["simulate_program", "a.rob"], None),
    (["get_running_program"], None),
    (["get_motor_temperatures"], ...),
    (["reset"], None),
    (["set_gripper_center", "1", "-2.5", "0"], None),
    (["get_gripper_center"], {"x": 1, "y": -2.5, "z": 0}),
    (["set_initial_tool_position", "200", "300", "324", "34.6", "34.5", "0"], None),
    (["get_initial_tool_position"], POSE),
    (["set_tool_coordinates", "100", "200", "300", "324", "34.6", "0", "0"], None),
    (["get_tool_coordinates"], {**POSE, "theta_y": 0}),
    (["get_joint_angles"], ...),
    (["release_joints"], None),
    (["lock_joints"], None),
    (["jog", "-y"], None),
    (["get_digital_inputs"], "00000000"),
    (["set_digital_output", "8", "1"], None),
    (["get_digital_outputs"], "0000000010000000"),
    (["get_analog_input", "8"], 0),
    (["set_password", "password", "password"], None),
    (["shutdown"], None),
]


def test_every_command_of_the_table(
    controller: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit status 0 and the expected result; fails for a new command without a call here."""
    monkeypatch.chdir(tmp_path)
    Path("a.rob").write_bytes(program_of(1))
    # Nothing moves that could be stopped.
    assert call(controller, "emergency_stop", "--json")[0] == 1
    for arguments, expected in SESSION:
        status, output = call(controller, *arguments, "--json")
        assert status == 0, (arguments, output)
        printed = json.loads(output)
        assert (printed["ok"], printed["command"]) == (True, arguments[0])
        assert expected is ... or printed["result"] == expected, arguments
    assert Path("b.rob").read_bytes() == program_of(1)
    assert {arguments[0] for arguments, _ in SESSION} | {"emergency_stop"} == set(OPERATIONS)


def test_output_is_readable_lines(controller: str) -> None:
    """Hyphens are accepted, options may be anywhere, negative numbers are arguments."""
    assert call(controller, "set-gripper-center", "1", "-2", "-0.5") == (0, "done")
    shown = call("--timeout", "5", controller, "get_gripper_center")
    assert shown == (0, "x  1 mm\ny  -2 mm\nz  -0.5 mm")
    assert call(controller, "get_status") == (0, "idle (00)")


def test_refusals_and_failures_are_status_1(controller: str) -> None:
    """The reason is a sentence or JSON."""
    status, sentence = call(controller, "run_program", "missing.rob")
    assert (status, sentence) == (
        1,
        "run_program was refused: 20, program file does not exist",
    )
    status, output = call(controller, "run_program", "missing.rob", "--json")
    error = json.loads(output)["error"]
    assert (status, error["kind"], error["code"]) == (1, "Refused", "20")
    status, sentence = call(controller, "get_status", "--password", "wrong")
    assert (status, "refused the password" in sentence) == (1, True)
    status, sentence = call(controller, "download", "missing.rob")
    assert (status, "refused the name" in sentence) == (1, True)


def test_the_password_may_come_from_the_environment(
    controller: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SCARASPEC_PASSWORD, which --password overrides."""
    monkeypatch.setenv("SCARASPEC_PASSWORD", "wrong")
    assert call(controller, "get_version")[0] == 1
    assert call(controller, "get_version", "--password", "password")[0] == 0
    assert call(controller, "login", "password") == (0, "done")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["tcp://127.0.0.1", "get_statu"], "there is no command 'get_statu': did you mean get_st"),
        (["tcp://127.0.0.1", "?"], "there is no command '?': scaraspec call --help lists them"),
        (["tcp://127.0.0.1", "jog", "up"], "direction 'up' is not one of +y, -y, +x, -x"),
        (["tcp://127.0.0.1", "jog"], "jog takes DIRECTION: 0 given"),
        (["tcp://127.0.0.1", "set_digital_output", "8", "2"], "value 2 is out of range: 0 to 1"),
        (["tcp://127.0.0.1", "get_version", "--jsn"], "get_version takes no arguments: 1 given"),
        (["tcp://127.0.0.1", "get_status", "--reading", "x=y"], "unknown reading 'x': "),
        (["tcp://127.0.0.1", "get_status", "--ics", "no.toml"], "no.toml cannot be read"),
        (["robot", "get_version"], "'robot' is not a link URL: write for example tcp://"),
    ],
)  # fmt: skip
def test_wrong_usage_is_status_2(arguments: list[str], sentence: str) -> None:
    """One sentence, before anything is sent."""
    status, reported = call(*arguments)
    assert status == 2
    assert reported.startswith(sentence)


@pytest.mark.parametrize("option", ["--reading", "--ics"])
def test_the_readings_of_the_controller_are_used(option: str, tmp_path: Path) -> None:
    """From the command line and from an ICS; the reply timeout is a reading, too."""
    (tmp_path / "ics.toml").write_text('[readings]\nreply_timeout = "0.1"\n')
    value = {"--reading": "reply_timeout=0.1", "--ics": str(tmp_path / "ics.toml")}[option]
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        status, sentence = call(url, "get_version", option, value)
    assert status == 3
    assert sentence.startswith("login got no reply within 0.1 s: another client may be connected")


def test_no_answer_is_status_3() -> None:
    """The controller is silent, or there is no controller."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        status, sentence = call(url, "get_version", "--timeout", "0.1")
        assert (status, sentence.split(":")[0]) == (3, "login got no reply within 0.1 s")
    status, sentence = call(url, "get_version", "--json")
    assert (status, json.loads(sentence)["error"]["kind"]) == (3, "LinkLost")


def test_timeout_applies_to_the_final_result(controller: str, tmp_path: Path) -> None:
    """The message states that the robot may be busy; another call stops it."""
    (tmp_path / "long.rob").write_bytes(program_of(200))
    assert call(controller, "upload", str(tmp_path / "long.rob")) == (0, "done")
    status, sentence = call(controller, "run_program", "long.rob", "--timeout", "1")
    assert (status, "get_status" in sentence) == (3, True)
    assert call(controller, "get_status") == (0, "running (01, running a program)")
    assert call(controller, "emergency_stop") == (0, "done")
    assert call(controller, "get_status") == (0, "idle (00)")


def test_an_accepted_command_is_announced(controller: str, tmp_path: Path) -> None:
    """Standard error states that the robot moves; JSON output does not."""
    (tmp_path / "short.rob").write_bytes(program_of(20))
    assert call(controller, "upload", str(tmp_path / "short.rob")) == (0, "done")
    running = [SCARASPEC, "call", controller, "run_program", "short.rob"]
    result = subprocess.run(
        running, check=False, capture_output=True, text=True, timeout=ENDS_WITHIN_S
    )
    assert (result.returncode, result.stdout.strip()) == (0, "done")
    assert result.stderr == "accepted, waiting for the final result; Ctrl-C ends the wait\n"


def test_an_interrupt_does_not_stop_the_robot(
    controller: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The message says that the robot continues and how to stop it."""

    def interrupt(_pending: Pending, _timeout_s: float | None) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Pending, "wait", interrupt)
    status, sentence = call(controller, "reset")
    assert (status, "emergency_stop stops it" in sentence) == (3, True)


def test_a_local_file_is_not_overwritten(controller: str, tmp_path: Path) -> None:
    """A usage error: nothing was transferred."""
    (tmp_path / "a.rob").write_bytes(b"old")
    status, sentence = call(controller, "download", "a.rob", str(tmp_path / "a.rob"))
    assert (status, "is not overwritten" in sentence) == (2, True)
    status, sentence = call(controller, "upload", str(tmp_path / "b.rob"))
    assert (status, sentence) == (2, f"{tmp_path / 'b.rob'}: No such file or directory")


def test_a_terminal_shows_progress(
    controller: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On standard error; standard output contains only the result."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    (tmp_path / "a.bin").write_bytes(bytes(1000))
    result = CliRunner().invoke(group, ["call", controller, "upload", str(tmp_path / "a.bin")])
    assert result.stdout == "done\n"
    assert "100%" in result.stderr


def test_help_names_every_command_with_its_arguments() -> None:
    """On one screen, with an example at the end."""
    shown = CliRunner().invoke(group, ["call", "--help"]).output
    words = shown.split()
    assert set(OPERATIONS) <= {word.rstrip(",") for word in words}
    assert "set_digital_output PORT VALUE" in shown
    assert len(shown.splitlines()) <= 40
    assert shown.splitlines()[-1].strip().startswith("Example: scaraspec call tcp://")


def test_a_call_is_a_process(controller: str) -> None:
    """The sentence is on standard error; the exit status is set."""
    done = subprocess.run(
        [SCARASPEC, "call", controller, "delete_program", "missing.rob"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        "scaraspec: delete_program was refused: the controller gives no reason\n"
    )
