"""Clause 3: undefined opcodes (L96; A-3-9). They are not sent to a real robot: it may move."""

import math
from collections.abc import Iterable
from typing import Final, NamedTuple

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import BY_OPCODE, JointValues, Point
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import MAX_DATA_BYTES, TAG, Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.transfer import BUFFER_BYTES, chunks_of
from scaraspec.suite.controller.harness.controller_under_test import MOMENT_S, ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.mutation_targets import GET_STATUS
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import (
    begin_upload,
    expect_stored,
    reconnect,
    send_chunk,
)
from scaraspec.suite.controller.harness.requests.motion import joints_of, wait_until_at_rest
from scaraspec.suite.controller.harness.requests.ports import (
    ALL_OUTPUTS,
    outputs_preserved,
    set_output,
)
from scaraspec.suite.controller.harness.requests.queries import supported_queries
from scaraspec.suite.controller.harness.state.defaults import (
    default_program_preserved,
    expect_default,
)
from scaraspec.suite.controller.harness.state.preserve import settings_preserved
from scaraspec.suite.controller.harness.two_stage.commands import RUN, require_command
from scaraspec.suite.controller.harness.two_stage.results import interrupted_result
from scaraspec.suite.controller.harness.two_stage.tasks import executing_task
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseSkipped, NoReply, expect, expect_equal
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.suite.engine.transfer_timeouts import Silence, transfer_timeouts_of
from scaraspec.suite.program_files.listed import store_program
from scaraspec.user_message import UserMessage

_UNDEFINED: Final = tuple(o for o in range(256) if o not in BY_OPCODE and o != TAG)
"""The tag is not included: no reply can have it as its opcode (A-3-5)."""
_DATA: Final = (b"", b"1", b"1|1", b"0" * MAX_DATA_BYTES)
_MOTION: Final = (Hazard.STATE, Hazard.MOTION)
_CENTER: Final = Point(10, -20, 30)
_OPCODES_PER_CHUNK: Final = 16
_CHANGING_VALUES: Final = (
    "get_time",
    "get_motor_temperatures",
    "get_joint_angles",
    "get_tool_coordinates",
    "get_digital_inputs",
    "get_analog_input",
)


@case("3/21", undefined=True)
def test_undefined_opcodes(subject: ControllerUnderTest) -> None:
    """No undefined opcode changes anything or is answered under another opcode."""
    subject.moved = True
    before = _read_state(subject)
    for data in _DATA:
        _send_each(subject, (Frame(A2C, opcode, data) for opcode in _UNDEFINED))
    line = subject.open(judged=False)
    line.send_frame(Frame(A2C, TAG))
    line.wait(MOMENT_S)
    line.close()
    _expect_unchanged(subject, before)


@case("3/21", name="alone", undefined=True)
def test_undefined_opcodes_alone(subject: ControllerUnderTest) -> None:
    """Undefined opcodes change nothing as the first requests of a connection, in one segment."""
    subject.moved = True
    before = _read_state(subject)
    line = subject.open(judged=False)
    line.send_bytes(b"".join(Frame(A2C, opcode).encode() for opcode in _UNDEFINED))
    line.wait(MOMENT_S)
    _expect_own_opcodes(subject, line, frozenset(_UNDEFINED))
    line.close()
    _expect_unchanged(subject, before)


@case("3/21", name="settings", hazards=_MOTION, undefined=True)
def test_settings_after_undefined_opcodes(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """A gripper center, a default program and active outputs are kept after undefined opcodes."""
    for name in ("set_gripper_center", "set_default_program", "set_digital_output"):
        require_command(subject, name)
    subject.require_multiple_connections()
    subject.moved = True
    program = store_program(subject, line)
    with (
        settings_preserved(subject, line, "gripper centre"),
        default_program_preserved(subject, line),
        outputs_preserved(line),
    ):
        default_set = line.ask("set_default_program", program).accepted
        settings_accepted = [line.ask("set_gripper_center", _CENTER).accepted, default_set]
        settings_accepted += [set_output(line, port, on=True).accepted for port in ALL_OUTPUTS]
        if not any(settings_accepted):
            raise CaseSkipped("the controller accepts none of these settings")
        wait_until_at_rest(subject, line)  # setting the default program may run it (A-4.12-3)
        before = _read_state(subject)
        _send_each(subject, (Frame(A2C, opcode) for opcode in _UNDEFINED))
        _expect_unchanged(subject, before)
        if default_set:
            expect_default(subject, subject.open(), program, "3/21")


@case("3/21", name="in-an-upload", hazards=(Hazard.STATE,), undefined=True)
def test_undefined_opcodes_in_an_upload(subject: ControllerUnderTest) -> None:
    """A file is stored unchanged although undefined opcodes are sent between its chunks."""
    name, opcodes = subject.new_name(), list(_UNDEFINED)
    content = content_of(BUFFER_BYTES * math.ceil(len(opcodes) / _OPCODES_PER_CHUNK))
    line = subject.open(judged=False)
    begin_upload(line, name)
    for chunk in chunks_of(content):
        silence = Silence(subject)
        for opcode in examples(opcodes[:_OPCODES_PER_CHUNK]):
            _send_with_query(subject, line, Frame(A2C, opcode))
            if line.ending is not None:
                raise CaseSkipped("the controller closes the connection after an undefined opcode")
        if silence.elapsed_s > transfer_timeouts_of(subject).must_survive_s:
            raise CaseSkipped("the transfer may have timed out while the replies were awaited")
        message = "an upload chunk was refused after undefined opcodes"
        send_chunk(line, chunk, "3/21", message)
        del opcodes[:_OPCODES_PER_CHUNK]
    expect_stored(reconnect(subject, line), name, content, "3/21")


@case("3/21", name="running", hazards=_MOTION, undefined=True)
def test_undefined_opcodes_during_a_program(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """A running program continues when another client sends all undefined opcodes together."""
    subject.require_multiple_connections()
    other = subject.open(judged=False)
    with executing_task(subject, line, RUN) as task:
        other.send_bytes(b"".join(Frame(A2C, opcode).encode() for opcode in _UNDEFINED))
        other.wait(MOMENT_S)
        _expect_own_opcodes(subject, other, frozenset(_UNDEFINED))
        status = line.ask("get_status")
        result = None if status.value == task.state else interrupted_result(line, RUN)
        expect(
            status.value == task.state or (result is not None and result.done),
            "a running program ended after undefined opcodes",
            expected=task.state,
            observed=f"{result or status}",
        )


def _send_each(subject: ControllerUnderTest, frames: Iterable[Frame]) -> None:
    """Send each frame, on a new connection if the controller closed the old one."""
    line = subject.open(judged=False)
    for frame in examples(frames):
        _send_with_query(subject, line, frame)
        if line.ending is not None:
            line = subject.open(judged=False)
    line.close()


def _send_with_query(subject: ControllerUnderTest, line: OutgoingConnection, frame: Frame) -> None:
    """Send a request with an undefined opcode, and then a query."""
    line.send_frame(frame)
    try:
        line.send_bytes(GET_STATUS)
        line.reply("get_status")
    except NoReply:
        expect(
            line.ending is not None,
            "no reply arrives after a request with an undefined opcode",
            expected="a reply to 0x09, or the end of the connection",
            observed=UserMessage("silence after opcode {opcode}", opcode=f"{frame.opcode:02X}"),
        )
    _expect_own_opcodes(subject, line, frozenset({frame.opcode}))


def _expect_own_opcodes(
    subject: ControllerUnderTest, line: OutgoingConnection, opcodes: frozenset[int]
) -> None:
    """Expect no reply to an undefined opcode, or replies with the same opcode."""
    if line.ending is not None:
        subject.tolerate("3/21", "on_unknown", "close", "the connection was closed")
    unsolicited = subject.observer.unsolicited_opcodes - opcodes
    for received in line.inbox:
        if received.frame.opcode in unsolicited:
            continue
        expect(
            received.frame.opcode in opcodes and not received.frame.tagged,
            "a request with an undefined opcode was answered under another opcode",
            expected="silence, or the opcode of the request",
            observed=f"{received.frame}",
        )
        subject.tolerate(
            "3/21",
            "on_unknown",
            "0",
            UserMessage("an undefined opcode is answered: {frame}", frame=received.frame),
        )
    line.inbox.clear()


# ---------------------------------------------------------------------- unchanged state


class _State(NamedTuple):
    """The reply data of each query, and the joint angles."""

    replies: dict[str, bytes]
    joints: JointValues


def _read_state(subject: ControllerUnderTest) -> _State:
    line = subject.open()
    replies = {
        query.name: line.ask(*query).frame.data
        for query in supported_queries(subject)
        if query.name not in _CHANGING_VALUES
    }
    state = _State(replies, joints_of(line))
    line.close()
    return state


def _expect_unchanged(subject: ControllerUnderTest, before: _State) -> None:
    subject.pause(MOMENT_S)
    after = _read_state(subject)
    deviation = max_deviation(after.joints, before.joints)
    message = "an undefined opcode moved the arm"
    expect(
        deviation <= STANDSTILL,
        message,
        observed=UserMessage("by {deviation}", deviation=f"{deviation:.2f}"),
    )
    for name, data in before.replies.items():
        expect_equal(
            after.replies[name],
            data,
            UserMessage("an undefined opcode changed the reply to {name}", name=name),
        )
