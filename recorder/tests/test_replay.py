"""Replay: which requests are sent, which are not, and the comparison of the replies."""

from collections import deque
from collections.abc import Callable, Iterator
from datetime import datetime
from typing import Any

import pytest

from scaraspec.protocol.commands import BY_NAME, JointValues
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import Acceptance
from scaraspec.protocol.transfer import Chunk
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.replay import LinkEndedError, ReplayStep, plan_steps, replay

READ_ONLY = {Hazard.READ_ONLY}
ALL = set(Hazard)


class Robot:
    """A link whose peer replies by a function; its clock advances only during waits."""

    def __init__(self, answer: Callable[[Frame], list[bytes]]) -> None:
        self.now_s = 100.0
        self.sent: list[tuple[float, bytes]] = []
        self._answer = answer
        self._framer = Framer(A2C)
        self._coming: deque[bytes] = deque()

    def send(self, data: bytes) -> None:
        self.sent.append((self.now_s, data))
        for frame in self._framer.feed(data):
            assert isinstance(frame, Frame)
            self._coming += self._answer(frame)

    def receive(self, deadline_s: float) -> tuple[int, object] | None:
        if self._coming:
            return 0, self._coming.popleft() or "closed"
        self.now_s = max(self.now_s, deadline_s)
        return None


def reply(name: str, value: Any) -> bytes:
    command = BY_NAME[name]
    return Frame(C2A, command.opcode, command.reply.encode(value)).encode()


def names(plan: Iterator[ReplayStep]) -> list[tuple[str, str]]:
    return [(step.name, step.reason) for step in plan]


def test_only_allowed_requests_are_sent(talk: Any) -> None:
    """The hazard of the command decides; unknown commands and invalid bytes are never sent."""
    talk.ask("login", b"secret", reply=True)
    talk.ask("get_status", None, "00")
    talk.ask("set_time", datetime(2026, 1, 1), reply=True)  # noqa: DTZ001 - the robot's clock knows no zone
    talk.ask("run_program", b"p.rob", Acceptance(accepted=True))
    talk.send(A2C, Frame(A2C, 0x3E).encode())
    talk.send(A2C, b"\x00\x01")
    talk.send(A2C, Frame(A2C, BY_NAME["get_analog_input"].opcode, b"xyz").encode())
    talk.ask("get_status", None, "00")
    found = names(plan_steps(talk.events, "1", READ_ONLY))
    assert found == [
        ("login", "state"),
        ("get_status", ""),
        ("set_time", "state"),
        ("run_program", "motion"),
        ("0x3E", "undefined opcode"),
        ("bytes", "not a frame"),
        ("get_analog_input", "malformed"),
        ("get_status", ""),
    ]
    everything = names(plan_steps(talk.events, "1", ALL))
    assert [reason for _, reason in everything if reason] == [
        "undefined opcode",
        "not a frame",
        "malformed",
    ]


def test_order_and_bytes_are_kept(shift: list[WireEvent]) -> None:
    """All requests are sent byte for byte, each after the reply to the one before."""
    robot = Robot(lambda _: [])
    done = [*replay(plan_steps(shift, "1", ALL), robot, reply_timeout_s=1)]
    recorded = b"".join(e.data for e in shift if e.direction is A2C and e.kind is Kind.BYTES)
    assert b"".join(data for _, data in robot.sent) == recorded
    moments = [moment_s for moment_s, _ in robot.sent]
    assert moments == [100.0 + number for number in range(len(moments))]
    assert all(step.frame or step.is_result for step in done)


def test_replies_are_compared_by_meaning(talk: Any) -> None:
    """Another status or a refusal differs, and so does silence; another temperature does not."""
    talk.ask("get_motor_temperatures", None, JointValues(30, 30, 30, 30))
    talk.ask("get_status", None, "00")
    talk.ask("run_program", b"p.rob", Acceptance(accepted=True))
    talk.ask("get_default_program", None, b"p.rob")
    talk.ask("get_analog_input", 3)
    answers = {
        "get_motor_temperatures": [reply("get_motor_temperatures", JointValues(33, 30, 28, 30))],
        "get_status": [reply("get_status", "12")],
        "run_program": [reply("run_program", Acceptance(accepted=False, code="01"))],
    }
    by_opcode = {BY_NAME[name].opcode: parts for name, parts in answers.items()}
    robot = Robot(lambda frame: by_opcode.get(frame.opcode, []))
    done = [*replay(plan_steps(talk.events, "1", ALL), robot, reply_timeout_s=1)]
    assert [(s.name, s.recorded_reply, s.new_reply, s.differs) for s in done] == [
        (
            "get_motor_temperatures",
            *("inner_arm 30 °C, outer_arm 30 °C, wrist 30 °C, rotation 30 °C",),
            *("inner_arm 33 °C, outer_arm 30 °C, wrist 28 °C, rotation 30 °C", False),
        ),
        ("get_status", "00 idle", "12 motor fault: outer arm", True),
        ("run_program", "accepted", "refused 01 running a program", True),
        ("get_default_program", "p.rob", "", True),
        ("get_analog_input", "", "", False),
    ]


@pytest.mark.parametrize(("outcome", "differs"), [(b"11", False), (b"00|12", True), (None, True)])
def test_a_final_result_is_waited_for(talk: Any, outcome: bytes | None, *, differs: bool) -> None:
    """The next request is sent after it, as in the capture, and the results are compared."""
    run = BY_NAME["run_program"].opcode
    talk.ask("run_program", b"p.rob", Acceptance(accepted=True))
    talk.time_ns += 3_000_000_000
    talk.send(C2A, Frame(C2A, run, b"11", tagged=True).encode())
    talk.ask("get_status", None, "00")
    accepted = [reply("run_program", Acceptance(accepted=True))]
    result = [Frame(C2A, run, outcome, tagged=True).encode()] if outcome else []
    answers = {run: accepted + result, BY_NAME["get_status"].opcode: [reply("get_status", "00")]}
    robot = Robot(lambda frame: answers[frame.opcode])
    done = [*replay(plan_steps(talk.events, "1", ALL), robot, reply_timeout_s=1)]
    assert [(s.name, s.is_result, s.differs) for s in done] == [
        ("run_program", False, False),
        ("run_program", True, differs),
        ("get_status", False, False),
    ]
    waited_s = robot.sent[1][0] - robot.sent[0][0]
    assert waited_s == (0 if outcome else pytest.approx(4, abs=0.1))


def test_no_result_of_a_refused_command_is_waited_for(talk: Any) -> None:
    run = BY_NAME["run_program"].opcode
    talk.ask("run_program", b"p.rob", Acceptance(accepted=True))
    talk.send(C2A, Frame(C2A, run, b"11", tagged=True).encode())
    robot = Robot(lambda _: [reply("run_program", Acceptance(accepted=False, code="01"))])
    _, result = replay(plan_steps(talk.events, "1", ALL), robot, reply_timeout_s=1)
    assert (result.reason, result.differs) == ("it was not accepted", False)
    assert robot.now_s == 100


def test_long_pauses_are_shortened(talk: Any) -> None:
    """Also a step of the clock by 100 days, in either direction."""
    for days in (0, 100, -100):
        talk.time_ns += days * 86_400 * 10**9
        talk.ask("get_status", None, "00")
    robot = Robot(lambda _: [reply("get_status", "00")])
    plan = plan_steps(talk.events, "1", READ_ONLY)
    list(replay(plan, robot, reply_timeout_s=1, speed=1, max_gap_s=60))
    assert [round(sent_s) for sent_s, _ in robot.sent] == [100, 160, 160]


def test_speed_scales_the_times_of_the_capture(talk: Any) -> None:
    """Twice the speed halves the time between requests."""
    for _ in range(3):
        talk.time_ns += 4_000_000_000
        talk.ask("get_status", None, "00")
    robot = Robot(lambda _: [reply("get_status", "00")])
    list(replay(plan_steps(talk.events, "1", READ_ONLY), robot, reply_timeout_s=1, speed=2))
    moments = [round(moment_s, 2) for moment_s, _ in robot.sent]
    assert moments == [100, 102, 104]


@pytest.mark.parametrize("asks", [True, False])
def test_a_reply_is_sent_only_after_its_request(talk: Any, *, asks: bool) -> None:
    """In a download the controller sends requests; the reply of the client waits for them."""
    chunk = Chunk(4, 0, 4, b"abcd")
    talk.ask("download_name", b"p.rob", reply=True)
    talk.ask("download_chunk", chunk, reply=True)
    command = BY_NAME["download_chunk"]
    requests = Frame(C2A, command.opcode, command.request.encode(chunk)).encode()
    name = reply("download_name", asks)
    by_opcode = {BY_NAME["download_name"].opcode: [name, requests] if asks else [name]}
    robot = Robot(lambda frame: by_opcode.get(frame.opcode, []))
    done = [*replay(plan_steps(talk.events, "1", READ_ONLY), robot, reply_timeout_s=1)]
    assert [step.name for step in done] == ["download_name", "download_chunk"]
    assert len(robot.sent) == 1 + asks
    assert done[1].reason == ("" if asks else "the controller did not send the request")


def test_the_end_of_the_link_ends_the_replay(talk: Any) -> None:
    """The controller closes the connection."""
    talk.ask("get_status", None, "00")
    robot = Robot(lambda _: [b""])
    with pytest.raises(LinkEndedError):
        list(replay(plan_steps(talk.events, "1", READ_ONLY), robot, reply_timeout_s=1))
