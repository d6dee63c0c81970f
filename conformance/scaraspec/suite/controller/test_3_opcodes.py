"""Clause 3: opcodes that nobody defined (L96; A-3-9); a real robot, which may move, gets none."""

from collections.abc import Iterable
from typing import Any, Final

from scaraspec.judgement.places import STANDSTILL, farthest
from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import MAX_DATA_BYTES, TAG, Frame
from scaraspec.suite.as_client.asking.motion import joints_of
from scaraspec.suite.as_client.asking.queries import known_to
from scaraspec.suite.as_client.line import Line
from scaraspec.suite.as_client.spoiling.carriers import GET_STATUS
from scaraspec.suite.as_client.subject import MOMENT_S, Subject
from scaraspec.suite.case import case
from scaraspec.suite.examples import examples
from scaraspec.suite.expect import NoAnswer, expect, expect_equal

_UNDEFINED: Final = tuple(o for o in range(256) if o not in BY_OPCODE and o != TAG)
"""No reply can bear the tag for its opcode (A-3-5), so what follows it is read on no connection."""
_DATA: Final = (b"", b"1", b"1|1", b"0" * MAX_DATA_BYTES)
_RESTLESS: Final = (
    "get_time",
    "get_motor_temperatures",
    "get_joint_angles",
    "get_tool_coordinates",
    "get_digital_inputs",
    "get_analog_input",
)


@case("3/21", undefined=True)
def test_undefined_opcodes(subject: Subject) -> None:
    """Every undefined opcode is sent; nothing happens, and no other opcode answers."""
    subject.moved = True
    before = _state(subject)
    for data in _DATA:
        _send(subject, (Frame(A2C, opcode, data) for opcode in _UNDEFINED))
    line = subject.open(judged=False)
    line.send_frame(Frame(A2C, TAG))
    line.wait(MOMENT_S)
    line.close()
    _expect_unchanged(subject, before)


@case("3/21", name="alone", undefined=True)
def test_undefined_opcodes_alone(subject: Subject) -> None:
    """Undefined opcodes are the first that a connection brings, and one segment brings them all."""
    subject.moved = True
    before = _state(subject)
    line = subject.open(judged=False)
    line.send_bytes(b"".join(Frame(A2C, opcode).encode() for opcode in _UNDEFINED))
    line.wait(MOMENT_S)
    _only_themselves(subject, line, frozenset(_UNDEFINED))
    line.close()
    _expect_unchanged(subject, before)


def _send(subject: Subject, frames: Iterable[Frame]) -> None:
    """Send each, with a query behind it, on a new connection where the subject closes."""
    line = subject.open(judged=False)
    for frame in examples(frames):
        line.send_frame(frame)
        try:
            line.send_bytes(GET_STATUS)
            line.reply("get_status")
        except NoAnswer:
            expect(
                line.ending is not None,
                "behind a request with an undefined opcode nothing is answered any more",
                expected="a reply to 0x09, or the end of the connection",
                observed=f"silence behind opcode {frame.opcode:02X}",
            )
        _only_themselves(subject, line, frozenset({frame.opcode}))
        if line.ending is not None:
            line = subject.open(judged=False)
    line.close()


def _only_themselves(subject: Subject, line: Line, opcodes: frozenset[int]) -> None:
    """An undefined opcode is answered under itself or not at all."""
    if line.ending is not None:
        subject.tolerate("3/21", "on_unknown", "close", "the connection was closed")
    told = subject.observer.told_unasked - opcodes
    for seen in line.heard:
        if seen.frame.opcode in told:
            continue
        expect(
            seen.frame.opcode in opcodes and not seen.frame.tagged,
            "a request with an undefined opcode was answered with another one",
            expected="silence, or the opcode of the request",
            observed=f"{seen.frame}",
        )
        subject.tolerate(
            "3/21", "on_unknown", "0", f"an undefined opcode is answered: {seen.frame}"
        )
    line.heard.clear()


# ---------------------------------------------------------------------- what must not change


def _state(subject: Subject) -> dict[str, Any]:
    line = subject.open()
    state: dict[str, Any] = {
        query.name: line.ask(*query).frame.data
        for query in known_to(subject)
        if query.name not in _RESTLESS
    }
    state["joints"] = joints_of(line)
    line.close()
    return state


def _expect_unchanged(subject: Subject, before: dict[str, Any]) -> None:
    subject.pause(MOMENT_S)
    after = _state(subject)
    joints = before.pop("joints")
    moved = farthest(after.pop("joints"), joints)
    expect(moved <= STANDSTILL, "an undefined opcode has moved the arm", observed=f"by {moved:.2f}")
    for name, data in before.items():
        expect_equal(after[name], data, f"an undefined opcode has changed what {name} tells")
