"""Table 8-1 against the document's rows, typed here by hand."""

from collections.abc import Iterable
from itertools import combinations

import pytest

from scaraspec.protocol.errors import (
    FAILURES,
    REFUSALS,
    RESERVED,
    STATES,
    TABLE_8_1,
    Code,
    Joint,
    Kind,
    code_for_joints,
    lookup,
)

INNER, OUTER, WRIST, ROTATION = Joint.INNER_ARM, Joint.OUTER_ARM, Joint.WRIST, Joint.ROTATION

# L1017-1044 as printed, without the closing 「；」.
DOCUMENT = [
    ("00", 1017, "空闲", Kind.IDLE, ()),
    ("01", 1018, "正在正常执行程序", Kind.RUNNING, ()),
    ("02", 1019, "正在模拟运行程序", Kind.RUNNING, ()),
    ("03", 1020, "正在复位", Kind.RUNNING, ()),
    ("04", 1021, "正在移动", Kind.RUNNING, ()),
    ("05", 1022, "坐标异常", Kind.FAULT, ()),
    ("06", 1023, "角度异常", Kind.FAULT, ()),
    ("07", 1024, "保留", Kind.RESERVED, ()),
    ("08", 1025, "保留", Kind.RESERVED, ()),
    ("09", 1027, "保留", Kind.RESERVED, ()),
    ("10", 1028, "保留", Kind.RESERVED, ()),
    ("11", 1029, "大臂关节电机错误", Kind.FAULT, (INNER,)),
    ("12", 1030, "小臂关节电机错误", Kind.FAULT, (OUTER,)),
    ("13", 1031, "大臂和小臂电机同时出错", Kind.FAULT, (INNER, OUTER)),
    ("14", 1032, "手腕关节电机错误", Kind.FAULT, (WRIST,)),
    ("15", 1033, "手腕关节和大臂关节电机出错", Kind.FAULT, (INNER, WRIST)),
    ("16", 1034, "手腕关节和小臂关节电机出错", Kind.FAULT, (OUTER, WRIST)),
    ("17", 1035, "手腕关节，大臂关节和小臂关节出错", Kind.FAULT, (INNER, OUTER, WRIST)),
    ("18", 1036, "夹具关节电机错误", Kind.FAULT, (ROTATION,)),
    ("19", 1037, "夹具关节和大臂关节电机出错", Kind.FAULT, (INNER, ROTATION)),
    ("1A", 1038, "夹具关节和小臂关节电机出错", Kind.FAULT, (OUTER, ROTATION)),
    ("1B", 1039, "夹具关节，大臂关节和小臂关节电机出错", Kind.FAULT, (INNER, OUTER, ROTATION)),
    ("1C", 1040, "夹具关节和手腕关节电机出错", Kind.FAULT, (WRIST, ROTATION)),
    ("1D", 1041, "夹具关节，手腕关节和大臂关节电机出错", Kind.FAULT, (INNER, WRIST, ROTATION)),
    ("1E", 1042, "夹具关节，手腕关节和小臂关节电机出错", Kind.FAULT, (OUTER, WRIST, ROTATION)),
    ("1F", 1043, "所有关机电机都出错", Kind.FAULT, (INNER, OUTER, WRIST, ROTATION)),
    ("20", 1044, "程序文件不存在", Kind.MISSING_FILE, ()),
]


def texts(codes: Iterable[Code]) -> list[str]:
    return sorted(code.text for code in codes)


def test_the_table_is_the_documents() -> None:
    """Texts, lines, words, kinds and joints are those of the 27 rows, in their order."""
    assert [
        (key, code.line, code.original, code.kind, code.joints) for key, code in TABLE_8_1.items()
    ] == DOCUMENT
    assert all(key == code.text for key, code in TABLE_8_1.items())


def test_motor_faults_read_as_english() -> None:
    """The English meaning of a motor code names its joints in joint order."""
    assert TABLE_8_1["12"].meaning == "motor fault: outer arm"
    assert TABLE_8_1["15"].meaning == "motor fault: inner arm and wrist"
    assert TABLE_8_1["1F"].meaning == "motor fault: inner arm, outer arm, wrist and rotation"


def test_every_set_of_joints_has_its_code() -> None:
    """Any non-empty set of joints, in any order and with repetitions, finds the row naming it."""
    sets = [joints for size in (1, 2, 3, 4) for joints in combinations(Joint, size)]
    assert [code_for_joints([*reversed(joints), *joints]).joints for joints in sets] == sets


def test_no_joint_has_no_code() -> None:
    """The table has no motor code for no motor; 10 is reserved."""
    with pytest.raises(ValueError, match="at least one joint"):
        code_for_joints([])


def test_lookup_takes_either_case() -> None:
    """Codes are compared as text in either case (A-T-7)."""
    assert lookup("1a") is lookup("1A") is TABLE_8_1["1A"]


@pytest.mark.parametrize("text", ["", "0", "21", "FF", "1G", " 1A", "001", "１１", "0x11"])
def test_lookup_of_anything_else_is_none(text: str) -> None:
    """Only the two characters of a row are a code."""
    assert lookup(text) is None


def test_where_a_code_may_stand() -> None:
    """States, refusals and failures are the sets of A-8-5; none holds a reserved code."""
    motors = [f"1{digit}" for digit in "123456789ABCDEF"]
    assert texts(STATES) == ["00", "01", "02", "03", "04", "05", "06", *motors]
    assert texts(REFUSALS) == ["01", "02", "03", "04", "05", "06", *motors, "20"]
    assert texts(FAILURES) == ["05", "06", *motors]
    assert texts(RESERVED) == ["07", "08", "09", "10"]
