"""Two-stage commands: states, refusals, results, faults, stops and a lost link."""

from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scaraspec.protocol.commands import COMMANDS
from scaraspec.protocol.program_files import Node, NodeType, Point

_MOVE = b"10|200|300|324|34.6|34.5|0"
_TWO_STAGE = [row.name for row in COMMANDS if row.two_stage]
_ARGUMENT = {
    "run_program": b"p",
    "simulate_program": b"p",
    "set_tool_coordinates": _MOVE,
    "jog": b"1",
}
# How each command that takes time is started, and the state that it gives (table 8-1, L1018-1021).
_ACTIVITIES = {
    "run_program": b"01",
    "simulate_program": b"02",
    "reset": b"03",
    "set_tool_coordinates": b"04",
    "jog": b"04",
}


@pytest.fixture
def busy_of(bench_of: Any) -> Any:
    """Return a function that makes a bench whose robot executes a command, and the client that sent
    it."""

    def make(activity: str, **readings: str) -> tuple[Any, Any]:
        bench = bench_of(**readings)
        bench.store_program(b"p")
        client = bench.client()
        if activity == "reset":
            client.ask("set_initial_tool_position", b"200|300|324|34.6|0|0")
        assert client.ask(activity, _ARGUMENT.get(activity, b"")) == b"1"
        bench.pass_s(0.5)
        return bench, client

    return make


@pytest.mark.parametrize(("activity", "state"), _ACTIVITIES.items())
def test_status_of_executing_commands(busy_of: Any, activity: str, state: bytes) -> None:
    """Requirements 4.8/3 to 4.8/7 and 4/7: the status has its code from the first reply to the
    final result."""
    bench, client = busy_of(activity)
    assert client.ask("get_status") == state
    assert client.result(activity) == b"11"
    assert client.ask("get_status") == b"00"
    assert client.receive(60.0) == []
    assert bench.core.next_event_s is None


@pytest.mark.parametrize("requested", [name for name in _TWO_STAGE if name != "emergency_stop"])
@pytest.mark.parametrize(("activity", "state"), _ACTIVITIES.items())
def test_a_busy_robot_refuses_with_its_state(
    busy_of: Any, activity: str, state: bytes, requested: str
) -> None:
    """Requirements 4/6 and 4/15: a second two-stage command is refused, whatever its data."""
    _, client = busy_of(activity)
    for data in (_ARGUMENT.get(requested, b""), b"\xff"):
        assert client.ask(requested, data) == b"0|" + state
    assert client.ask("get_status") == state


@pytest.mark.parametrize(("activity", "state"), _ACTIVITIES.items())
def test_an_emergency_stop_interrupts_everything(busy_of: Any, activity: str, state: bytes) -> None:
    """4.17: the interrupted command fails with 00, a jog succeeds, then the stop succeeds."""
    _, client = busy_of(activity)
    assert client.ask("get_status") == state
    client.send("emergency_stop")
    assert client.receive() == [
        ("emergency_stop", b"1"),
        (f"*{activity}", b"11" if activity == "jog" else b"00|00"),
        ("*emergency_stop", b"11"),
    ]
    assert client.ask("get_status") == b"00"
    angles = client.ask("get_joint_angles")
    assert client.receive(60.0) == []
    assert client.ask("get_joint_angles") == angles


@pytest.mark.parametrize(
    ("reading", "results"),
    [("after", ["*emergency_stop", "*jog"]), ("none", ["*emergency_stop"])],
)
def test_order_of_the_interrupted_result_is_a_reading(
    busy_of: Any, reading: str, results: list[str]
) -> None:
    """The result comes after that of the stop, or never (A-4.17-4 b and c)."""
    _, client = busy_of("jog", estop_interrupted=reading)
    client.send("emergency_stop")
    assert [name for name, _ in client.receive()] == ["emergency_stop", *results]


def test_an_emergency_stop_by_another_client(busy_of: Any) -> None:
    """A-2-2: the result of the interrupted move goes to the client that sent the move."""
    bench, mover = busy_of("set_tool_coordinates")
    stopper = bench.client()
    stopper.send("emergency_stop")
    assert stopper.receive() == [("emergency_stop", b"1"), ("*emergency_stop", b"11")]
    assert mover.receive() == [("*set_tool_coordinates", b"00|00")]


def test_a_stop_of_an_idle_robot_is_answered_0(bench: Any) -> None:
    """L363-366: the reply is 0 also with a fault or released joints, when nothing moves."""
    client = bench.client()
    assert client.ask("emergency_stop") == b"0"
    bench.break_motor("13")
    assert client.ask("emergency_stop") == b"0"


def test_queries_and_ports_work_during_execution(busy_of: Any) -> None:
    """A-4-3 (a): all queries, and settings of outputs (A-4.32-4)."""
    _, client = busy_of("run_program")
    for row in COMMANDS:
        if row.hazard.value == "read-only" and row.name != "download_chunk":
            data = b"p" if row.name == "download_name" else b"01"
            client.send(row.name, data)
            assert client.receive()[0][0] == row.name
    assert client.ask("set_digital_output", b"1|1") == b"1"


# --------------------------------------------------------------------------- moving


def test_a_move_takes_time_and_arrives(bench: Any) -> None:
    """Requirements 4.24/8 and 4.27/6: angles and coordinates change on the way."""
    client = bench.client()
    places, angles = [client.where()], [client.ask("get_joint_angles")]
    assert client.ask("set_tool_coordinates", _MOVE) == b"1"
    for _ in range(3):
        assert client.receive(0.5) == []
        places.append(client.where())
        angles.append(client.ask("get_joint_angles"))
    assert client.result("set_tool_coordinates") == b"11"
    assert client.where() == [200, 300, 324, 34.6, 0, 0]
    assert len({tuple(place) for place in places}) == 4
    assert len(set(angles)) == 4


@pytest.mark.parametrize(
    ("target", "code"),
    [
        (b"10|1000000|0|250|0|0|0", b"05"),
        (b"10|401|0|250|0|0|0", b"05"),
        (b"10|300|0|351|0|0|0", b"05"),
        (b"10|300|0|250|999|0|0", b"06"),
        (b"10|-300|-1|250|0|0|0", b"06"),
        (b"0|300|0|250|0|0|0", b"05"),
        (b"101|300|0|250|0|0|0", b"05"),
        (b"10.5|300|0|250|0|0|0", b"05"),
        (b"300|0|250|0|0|0", b"05"),
        (b"10 300 0 250 0 0 0", b"05"),
        (b"", b"05"),
        (b"\xff" * 255, b"05"),
    ],
    ids=repr,
)
def test_an_impossible_move_is_refused(bench: Any, target: bytes, code: bytes) -> None:
    """Requirements 4.24/3, 4.24/4 and 4.24/9: with 05 or 06 (A-4.24-5), and nothing moves."""
    client = bench.client()
    before = client.where()
    assert client.ask("set_tool_coordinates", target) == b"0|" + code
    assert client.receive(10.0) == []
    assert client.where() == before


def test_only_the_refusal_of_a_move_can_lack_its_code(bench_of: Any) -> None:
    """A-4.24-3 (b): only 4.24 prints the length 1."""
    bench = bench_of(err_bare0="0")
    client = bench.client()
    assert client.ask("set_tool_coordinates", b"") == b"0"
    assert client.ask("jog", b"9") == b"0|05"


def test_the_separator_before_a_code_is_a_reading(bench_of: Any) -> None:
    """A-0-2 (b): a space, in refusals and in results."""
    bench = bench_of(err_sep="space")
    client = bench.client()
    assert client.ask("jog", b"9") == b"0 05"
    client.ask("jog", b"1")
    bench.break_motor("12")
    assert client.receive() == [("*jog", b"00 12")]


def test_coordinates_can_mean_the_gripper(bench_of: Any) -> None:
    """A-4.23-1 (b): the commanded pose is reported, and the arm is at another position."""
    bench = bench_of(pose_point="gripper")
    client = bench.client()
    client.ask("set_gripper_center", b"0|30|-20")
    assert client.where() == [300, 30, 230, 0, 0, 0]
    assert client.ask("set_tool_coordinates", b"50|200|250|250|90|0|0") == b"1"
    assert client.result("set_tool_coordinates") == b"11"
    assert client.where() == [200, 250, 250, 90, 0, 0]


@pytest.mark.parametrize(("number", "axis", "sign"), [(1, 1, 1), (2, 1, -1), (3, 0, 1), (4, 0, -1)])
@pytest.mark.parametrize("binary", [False, True])
def test_a_jog_moves_along_its_axis(
    bench: Any, number: int, axis: int, sign: int, *, binary: bool
) -> None:
    """Requirement 4.28/3 (L605-608), with either notation of the byte (A-4.28-1)."""
    client = bench.client()
    before = client.where()
    assert client.ask("jog", bytes([number if binary else 0x30 + number])) == b"1"
    assert client.receive(2.0) == []
    after = client.where()
    assert sign * (after[axis] - before[axis]) == pytest.approx(40, abs=1)
    assert after[1 - axis] == pytest.approx(before[1 - axis], abs=1)


def test_a_jog_can_take_binary_numbers_only(bench_of: Any) -> None:
    """A digit as direction is refused (A-4.28-1 b)."""
    client = bench_of(jog_byte="binary").client()
    assert client.ask("jog", b"1") == b"0|05"
    assert client.ask("jog", b"\x01") == b"1"


@pytest.mark.parametrize("data", [b"", b"0", b"5", b"\x00", b"\x05", b"11", b"1|", b"\xff"])
def test_an_invalid_jog_is_refused(bench: Any, data: bytes) -> None:
    """An invalid direction is refused, and the arm does not move (4.28/7)."""
    client = bench.client()
    before = client.where()
    assert client.ask("jog", data) == b"0|05"
    assert client.receive(2.0) == []
    assert client.where() == before


def test_a_jog_succeeds_at_the_limit(bench: Any) -> None:
    """A-4.28-6 (a): the result is 11, and 11 again if the arm is at the limit already."""
    client = bench.client()
    assert client.ask("jog", b"3") == b"1"
    assert client.result("jog") == b"11"
    client.send("jog", b"3")
    assert client.receive() == [("jog", b"1"), ("*jog", b"11")]


def test_a_jog_ends_with_its_link(bench: Any) -> None:
    """A-2-8 (b): no other client could stop it."""
    jogger, watcher = bench.client(), bench.client()
    jogger.ask("jog", b"1")
    bench.pass_s(1.0)
    jogger.link.reset()
    assert watcher.ask("get_status") == b"00"
    place = watcher.where()
    bench.pass_s(1.0)
    assert watcher.where() == place


# --------------------------------------------------------------------------- released


def test_released_joints_refuse_motion_until_locked(bench: Any) -> None:
    """A-4.25-1 (a): motion is refused with 06; a simulation moves nothing and may start."""
    bench.store_program(b"p")
    client = bench.client()
    client.send("release_joints")
    assert client.receive() == [("release_joints", b"1"), ("*release_joints", b"11")]
    assert not bench.plant.locked
    assert client.ask("get_status") == b"00"
    for name in ("run_program", "reset", "set_tool_coordinates", "jog"):
        assert client.ask(name, _ARGUMENT.get(name, b"")) == b"0|06"
    client.send("lock_joints")
    assert client.receive() == [("lock_joints", b"1"), ("*lock_joints", b"11")]
    assert client.ask("jog", b"1") == b"1"


@pytest.mark.parametrize("name", ["release_joints", "lock_joints"])
def test_releasing_and_locking_may_be_repeated(bench: Any, name: str) -> None:
    """A second release or lock succeeds, too (A-4.25-3 a)."""
    client = bench.client()
    for _ in range(2):
        client.send(name)
        assert client.receive() == [(name, b"1"), (f"*{name}", b"11")]


# --------------------------------------------------------------------------- faults


@pytest.mark.parametrize("code", ["05", "06", *(f"{0x10 + mask:02X}" for mask in range(1, 16))])
@pytest.mark.parametrize("activity", _ACTIVITIES)
def test_a_fault_fails_the_executing_command(busy_of: Any, activity: str, code: str) -> None:
    """Requirements 4/3, 4.8/8 and 8/4: the result is 00|code; then status and refusals have the
    code."""
    bench, client = busy_of(activity)
    bench.break_motor(code)
    assert client.receive() == [(f"*{activity}", b"00|" + code.encode())]
    assert client.ask("get_status") == code.encode()
    place = client.where()
    for name in _TWO_STAGE:
        if name not in ("emergency_stop", "reset"):
            assert client.ask(name, _ARGUMENT.get(name, b"")) == b"0|" + code.encode()
    assert client.where() == place


def test_a_reset_clears_faults_and_moves_home(bench: Any) -> None:
    """A-4.18-2 (b) and A-4.18-3: the status is 03 during the motion, and 00 at the initial
    position."""
    client = bench.client()
    client.ask("set_tool_coordinates", _MOVE)
    bench.pass_s(1.0)
    bench.break_motor("1F")
    assert client.receive() == [("*set_tool_coordinates", b"00|1F")]
    assert client.ask("reset") == b"1"
    assert client.ask("get_status") == b"03"
    assert client.result("reset") == b"11"
    assert client.ask("get_status") == b"00"
    assert client.where() == [300, 0, 250, 0, 0, 0]


def test_a_reset_fails_while_the_cause_lasts(bench: Any) -> None:
    """L411-419:

    00|11 if the motor of the inner arm has a fault; after a repair, a reset succeeds.
    """
    client = bench.client()
    bench.break_motor("11", lasting=True)
    client.send("reset")
    assert client.receive() == [("reset", b"1"), ("*reset", b"00|11")]
    assert client.ask("get_status") == b"11"
    bench.plant.repair()
    assert client.ask("get_status") == b"11"
    client.send("reset")
    assert client.receive() == [("reset", b"1"), ("*reset", b"11")]
    assert client.ask("get_status") == b"00"


def test_a_reset_can_be_for_idle_robots_only(bench_of: Any) -> None:
    """A-4.18-2 (a): read literally, a reset in an error state is refused."""
    bench = bench_of(reset_from_error="idle-only")
    client = bench.client()
    client.send("reset")
    assert client.receive() == [("reset", b"1"), ("*reset", b"11")]
    bench.break_motor("12")
    assert client.ask("reset") == b"0|12"


def test_recovery_of_a_released_robot_in_an_error_state(bench: Any) -> None:
    """A reset clears the fault but fails, because the arm cannot move; then the joints can be
    locked."""
    client = bench.client()
    client.send("release_joints")
    client.receive()
    bench.break_motor("14")
    assert client.ask("lock_joints") == b"0|14"
    client.send("reset")
    assert client.receive() == [("reset", b"1"), ("*reset", b"00|06")]
    client.send("lock_joints")
    assert client.receive()[-1] == ("*lock_joints", b"11")
    client.send("reset")
    assert client.receive()[-1] == ("*reset", b"11")


def test_a_reset_to_an_unreachable_position_is_refused(bench: Any) -> None:
    """A-4.24-5: a position that only the other elbow reaches is refused with 06, also in an error
    state."""
    client = bench.client()
    assert client.ask("set_initial_tool_position", b"-200|150|250|0|0|0") == b"1"
    bench.store_program(b"p", Node(b"", NodeType.POINT, data=Point((0.0, -80.0, 250.0, 0.0))))
    client.ask("run_program", b"p")
    assert client.result("run_program") == b"11"
    assert client.ask("reset") == b"0|06"
    bench.break_motor("11")
    client.send("reset")
    assert client.receive() == [("reset", b"1"), ("*reset", b"00|06")]
    assert client.ask("get_status") == b"00"


def test_faults_add_up_joint_by_joint(bench: Any) -> None:
    """A-8-1: the code is a bit mask."""
    client = bench.client()
    bench.break_motor("11")
    bench.break_motor("18")
    assert client.ask("get_status") == b"19"


# --------------------------------------------------------------------------- busy: other readings


def test_a_busy_robot_can_be_silent(busy_of: Any) -> None:
    """A-4-2 (b): two-stage commands get no reply, except the reset and the stop."""
    _, client = busy_of("run_program", busy_reply="silence")
    assert client.ask("jog", b"1") is None
    assert client.ask("reset") == b"0|01"
    assert client.ask("get_status") == b"01"
    assert client.ask("shutdown") == b"0|01"
    client.send("emergency_stop")
    assert client.receive()[0] == ("emergency_stop", b"1")
    assert client.ask("jog", b"1") == b"1"


def test_a_busy_robot_can_queue(busy_of: Any) -> None:
    """A-4-2 (c): queued requests are executed later, in order, until one is refused."""
    _, client = busy_of("set_tool_coordinates", busy_reply="queue")
    for name, data in (("release_joints", b""), ("jog", b"1"), ("lock_joints", b"")):
        assert client.ask(name, data) is None
    assert client.receive(60.0) == [
        ("*set_tool_coordinates", b"11"),
        ("release_joints", b"1"),
        ("*release_joints", b"11"),
        ("jog", b"0|06"),
        ("lock_joints", b"1"),
        ("*lock_joints", b"11"),
    ]


def test_a_stop_or_a_lost_link_empties_the_queue(busy_of: Any) -> None:
    """No motion may start right after an emergency stop, or for a client that has disconnected."""
    bench, client = busy_of("run_program", busy_reply="queue")
    other = bench.client()
    assert other.ask("jog", b"1") is None
    other.link.close()
    assert client.result("run_program") == b"11"
    assert client.ask("get_status") == b"00"
    client.ask("jog", b"1")
    assert client.ask("jog", b"2") is None
    client.send("emergency_stop")
    assert len(client.receive(10.0)) == 3


def test_a_queued_request_starts_after_the_jog_is_interrupted(busy_of: Any) -> None:
    """A-2-8 together with A-4-2 (c)."""
    bench, jogger = busy_of("jog", busy_reply="queue")
    other = bench.client()
    assert other.ask("lock_joints") is None
    jogger.link.close()
    assert other.receive() == [("lock_joints", b"1"), ("*lock_joints", b"11")]


@pytest.mark.parametrize("event", ["open", "receive", "close", "advance"])
def test_past_events_come_before_new_input(bench: Any, event: str) -> None:
    """If the core is called late, the result of a finished move comes first."""
    core = bench.core
    core.open(1, 0.0, "serial")
    (reply,) = core.receive(1, b"\xaa\x39\x1399|300|10|250|0|0|0\xcc", 0.0)
    assert reply.data == b"\xcc\x39\x011\xaa"
    late_s = bench.plant.motion_ends_s + 1.0
    arguments = {"open": (2, late_s, "serial"), "receive": (1, b"", late_s), "advance": (late_s,)}
    if event == "close":
        core.open(2, 0.0, "serial")
    actions = getattr(core, event)(*arguments.get(event, (2, late_s)))
    assert actions[0] == (1, b"\xcc\x90\x39\x0211\xaa")


def test_the_queue_is_limited(busy_of: Any) -> None:
    """If the queue is full, requests are refused with the state."""
    _, client = busy_of("run_program", busy_reply="queue")
    answers = [client.ask("lock_joints") for _ in range(20)]
    assert answers == [None] * 16 + [b"0|01"] * 4


# --------------------------------------------------------------------------- temperatures


def test_motors_warm_while_they_move_and_cool_at_rest(bench: Any) -> None:
    """4.14: whole degrees, in the order of the joints."""
    client = bench.client()
    assert client.ask("get_motor_temperatures") == b"25|25|25|25"
    for target in (b"100|200|300|250|0|0|0", b"100|200|-300|250|0|0|0") * 5:
        client.ask("set_tool_coordinates", target)
        client.result("set_tool_coordinates")
    warm = [int(text) for text in client.ask("get_motor_temperatures").split(b"|")]
    assert warm[0] > 25
    assert warm[2] == 25
    bench.pass_s(600.0)
    assert client.ask("get_motor_temperatures") == b"25|25|25|25"


def test_temperatures_can_be_answered_under_the_printed_opcode(bench_of: Any) -> None:
    """A-4.14-1 (b): 0x0E, with four fields."""
    client = bench_of(op_temp_reply="0x0E").client()
    client.send("get_motor_temperatures")
    assert client.receive() == [("set_default_program", b"25|25|25|25")]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(steps=st.lists(st.sampled_from([*_TWO_STAGE, "wait", "fault", "repair"]), max_size=25))
def test_every_accepted_command_has_exactly_one_final_result(
    bench_of: Any, steps: list[str]
) -> None:
    """Requirements 3/16 to 3/18: one after the first reply 1, none after the first reply 0."""
    bench = bench_of()
    bench.store_program(b"p")
    client = bench.client()
    received = []
    for step in steps:
        match step:
            case "wait":
                bench.pass_s(1.0)
            case "fault":
                bench.break_motor("12", lasting=True)
            case "repair":
                bench.plant.repair()
            case name:
                client.send(name, _ARGUMENT.get(name, b""))
        received += client.receive()
    received += client.receive(120.0)
    pending: set[str] = set()
    for name, data in received:
        if name.startswith("*"):
            pending.remove(name[1:])
        elif data == b"1":
            assert name not in pending
            pending.add(name)
    assert not pending
