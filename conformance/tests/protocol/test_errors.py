"""Table 8-1 compared with the rows of the document, which are typed here by hand."""

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


def test_table_matches_the_document() -> None:
    """The 27 rows have the texts, lines, wording, kinds, joints and order of the document."""
    assert [
        (key, code.line, code.original, code.kind, code.joints) for key, code in TABLE_8_1.items()
    ] == DOCUMENT
    assert all(key == code.text for key, code in TABLE_8_1.items())


def test_meaning_of_motor_faults() -> None:
    """The English meaning of a motor code lists its joints in the order of `Joint`."""
    assert TABLE_8_1["12"].meaning == "motor fault: outer arm"
    assert TABLE_8_1["15"].meaning == "motor fault: inner arm and wrist"
    assert TABLE_8_1["1F"].meaning == "motor fault: inner arm, outer arm, wrist and rotation"


def test_code_for_joints() -> None:
    """Any non-empty set of joints has its row, whatever the order and repetitions."""
    sets = [joints for size in (1, 2, 3, 4) for joints in combinations(Joint, size)]
    assert [code_for_joints([*reversed(joints), *joints]).joints for joints in sets] == sets


def test_code_for_no_joint() -> None:
    """The table has no motor code without a joint; 10 is reserved."""
    with pytest.raises(ValueError, match="at least one joint"):
        code_for_joints([])


def test_lookup_ignores_case() -> None:
    """Codes are compared as text, upper or lower case (A-T-7)."""
    assert lookup("1a") is lookup("1A") is TABLE_8_1["1A"]


@pytest.mark.parametrize("text", ["", "0", "21", "FF", "1G", " 1A", "001", "１１", "0x11"])
def test_lookup_of_unknown_text(text: str) -> None:
    """Only the two characters of a row are a code."""
    assert lookup(text) is None


def test_allowed_codes_of_each_message() -> None:
    """States, refusals and failures are the sets of A-8-5; none holds a reserved code."""
    motors = [f"1{digit}" for digit in "123456789ABCDEF"]
    assert texts(STATES) == ["00", "01", "02", "03", "04", "05", "06", *motors]
    assert texts(REFUSALS) == ["01", "02", "03", "04", "05", "06", *motors, "20"]
    assert texts(FAILURES) == ["05", "06", *motors]
    assert texts(RESERVED) == ["07", "08", "09", "10"]
