"""Table 8-1, the error codes: what each code means and in which messages it may occur.

This module contains the table and its lookup. It does not define what a robot does on an error.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType


class Joint(Enum):
    """The four joints in the order of L299; the value is the joint's bit in a motor code (A-8-1).

    The table's 夹具 (gripper) joint is the 旋转 (rotation) motor of 4.14 (A-0-8).
    """

    INNER_ARM = 1
    OUTER_ARM = 2
    WRIST = 4
    ROTATION = 8


class Kind(Enum):
    """What a code reports; the first three are the states of 4.8 (L214)."""

    IDLE = "idle"
    RUNNING = "running"
    FAULT = "fault"
    RESERVED = "reserved"
    MISSING_FILE = "missing file"


@dataclass(frozen=True, slots=True)
class Code:
    """One row of table 8-1.

    Attributes:
        text: The two characters on the wire in upper case ("1A"); text, not a number (L1014).
        meaning: The meaning in English.
        original: The document's text without the closing punctuation.
        line: The line of the document, for example 1038.
        kind: What the code reports.
        joints: The joints with a motor fault, in table order; empty except for 11-1F.
    """

    text: str
    meaning: str
    original: str
    line: int
    kind: Kind
    joints: tuple[Joint, ...] = ()


_ENGLISH_NAMES = {
    Joint.INNER_ARM: "inner arm",
    Joint.OUTER_ARM: "outer arm",
    Joint.WRIST: "wrist",
    Joint.ROTATION: "rotation",
}

# In the order in which the rows of the table list the joints.
_CHINESE_NAMES = {
    Joint.ROTATION: "夹具关节",
    Joint.WRIST: "手腕关节",
    Joint.INNER_ARM: "大臂关节",
    Joint.OUTER_ARM: "小臂关节",
}

# Three rows differ in wording from the others; 关机 in the last is a misprint of 关节 (A-0-8).
_IRREGULAR_WORDING = {
    0b0011: "大臂和小臂电机同时出错",
    0b0111: "手腕关节，大臂关节和小臂关节出错",
    0b1111: "所有关机电机都出错",
}


def _join_words(words: list[str], comma: str, conjunction: str) -> str:
    *head, last = words
    return comma.join(head) + conjunction + last if head else last


def _motor_code(mask: int) -> Code:
    """Return the row for a set of joints: hex 10 plus their bits (A-8-1, L1029-1043)."""
    joints = tuple(joint for joint in Joint if joint.value & mask)
    english = [_ENGLISH_NAMES[joint] for joint in joints]
    chinese = [word for joint, word in _CHINESE_NAMES.items() if joint in joints]
    verb = "电机错误" if len(joints) == 1 else "电机出错"
    return Code(
        text=f"{0x10 + mask:02X}",
        meaning=f"motor fault: {_join_words(english, ', ', ' and ')}",
        original=_IRREGULAR_WORDING.get(mask, _join_words(chinese, "，", "和") + verb),
        line=1028 + mask,
        kind=Kind.FAULT,
        joints=joints,
    )


_CODES = (
    Code("00", "idle", "空闲", 1017, Kind.IDLE),
    Code("01", "running a program", "正在正常执行程序", 1018, Kind.RUNNING),
    Code("02", "simulating a program", "正在模拟运行程序", 1019, Kind.RUNNING),
    Code("03", "resetting", "正在复位", 1020, Kind.RUNNING),
    Code("04", "moving", "正在移动", 1021, Kind.RUNNING),
    Code("05", "coordinates out of range", "坐标异常", 1022, Kind.FAULT),
    Code("06", "joint angle out of range", "角度异常", 1023, Kind.FAULT),
    Code("07", "reserved", "保留", 1024, Kind.RESERVED),
    Code("08", "reserved", "保留", 1025, Kind.RESERVED),
    Code("09", "reserved", "保留", 1027, Kind.RESERVED),
    Code("10", "reserved", "保留", 1028, Kind.RESERVED),
    *(_motor_code(mask) for mask in range(0b0001, 0b1111 + 1)),
    Code("20", "program file does not exist", "程序文件不存在", 1044, Kind.MISSING_FILE),
)

TABLE_8_1: Mapping[str, Code] = MappingProxyType({code.text: code for code in _CODES})
"""All codes of the table by their upper-case text, in the order of the table (L1016-1044)."""

RESERVED = frozenset(code for code in _CODES if code.kind is Kind.RESERVED)
"""The codes 07-10, which a controller must not send (A-8-3)."""

FAILURES = frozenset(code for code in _CODES if code.kind is Kind.FAULT)
"""Codes of a failed final result, ``00|code`` (A-8-5).

``00|00`` for a command that 0x32 interrupted (A-4.17-4) and ``00|20`` for a missing program that
is found late (A-4.15-1) are not included: their own register entries tolerate them.
"""

STATES = FAILURES | {code for code in _CODES if code.kind in (Kind.IDLE, Kind.RUNNING)}
"""Codes that 0x09 may report (A-8-5)."""

BUSY = tuple(code.text for code in _CODES if code.kind is Kind.RUNNING)
"""The texts of the codes of a robot that executes a command (L1018-1021)."""

REFUSALS = FAILURES | {code for code in _CODES if code.kind in (Kind.RUNNING, Kind.MISSING_FILE)}
"""Codes of a first reply that refuses a command, ``0|code`` (A-8-5)."""


def lookup(text: str) -> Code | None:
    """Return the code with this text in either case (A-T-7), or None if the table has none."""
    return TABLE_8_1.get(text.upper())


def code_for_joints(joints: Iterable[Joint]) -> Code:
    """Return the code that reports motor faults of exactly these joints (A-8-1).

    Raises:
        ValueError: `joints` is empty.
    """
    mask = 0
    for joint in joints:
        mask |= joint.value
    if not mask:
        raise ValueError(
            "a motor fault needs at least one joint: table 8-1 has no code without a joint"
        )
    return TABLE_8_1[f"{0x10 + mask:02X}"]
