"""The text interface: arguments from text, results as lines and as JSON."""

import json
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.client import Failed, LinkLost, Refused, RunningProgram, Status
from scaraspec.client.text_interface import (
    OPERATIONS,
    error_to_json,
    format_result,
    name_text,
    parse_arguments,
    parse_name,
    to_json,
)
from scaraspec.protocol.commands import BY_NAME, JointValues, Network, Point
from scaraspec.protocol.errors import TABLE_8_1
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.payloads import JogDirection

NOON = datetime(2014, 12, 22, 14, 30)  # noqa: DTZ001 - the document names no zone


@pytest.mark.parametrize(
    ("name", "texts", "values"),
    [
        ("get_time", [], []),
        ("set_digital_output", ["8", "1"], [8, 1]),
        ("set_gripper_center", ["1", "-2.5", "0"], [1.0, -2.5, 0.0]),
        ("set_time", ["20141222143000"], [NOON]),
        ("set_time", ["2014-12-22T14:30:00"], [NOON]),
        ("run_program", ["程序.rob"], ["程序.rob".encode()]),
        ("run_program", ["\udcff"], [b"\xff"]),
        ("set_password", ["1", "-2"], ["1", "-2"]),
        ("set_network", ["1.1.1.1", "2.2.2.2", "3.3.3.03"], ["1.1.1.1", "2.2.2.2", "3.3.3.3"]),
        ("jog", ["-y"], [JogDirection.MINUS_Y]),
        ("upload", ["a.rob"], ["a.rob"]),
        ("download", ["a.rob", "b.rob"], [b"a.rob", "b.rob"]),
    ],
)  # fmt: skip
def test_arguments_are_parsed_to_the_types_of_the_table(
    name: str, texts: list[str], values: list[Any]
) -> None:
    """Numbers and times are converted; names and passwords stay text."""
    assert parse_arguments(name, texts) == values


@pytest.mark.parametrize(
    ("name", "texts", "sentence"),
    [
        ("get_time", ["now"], "get_time takes no arguments: 1 given"),
        ("set_digital_output", ["8"], "set_digital_output takes PORT VALUE: 1 given"),
        ("download", [], r"download takes REMOTE \[LOCAL\]: 0 given"),
        ("set_digital_output", ["8", "2"], "value 2 is out of range: 0 to 1"),
        ("set_digital_output", ["8", "on"], "value 'on' is not an integer"),
        ("set_gripper_center", ["1", "1e3", "0"], "y '1e3' is not a plain decimal number"),
        ("set_gripper_center", ["1", "nan", "0"], "y 'nan' is not a plain decimal number"),
        ("jog", ["up"], r"direction 'up' is not one of \+y, -y, \+x, -x"),
        ("set_time", ["noon"], "time 'noon' is not 14 digits"),
        ("set_time", ["20141332143000"], "not a valid date and time"),
        ("set_network", ["999.1.1.1", "255.0.0.0", "1.1.1.1"], "ip '999.1.1.1' is not a dotted"),
    ],
)
def test_invalid_arguments_raise_one_sentence(name: str, texts: list[str], sentence: str) -> None:
    """The message says which argument is wrong and why."""
    with pytest.raises(PayloadError, match=sentence):
        parse_arguments(name, texts)


RESULTS: list[tuple[str, Any, list[str], Any]] = [
    ("set_time", None, ["done"], None),
    ("get_running_program", None, ["no program runs"], None),
    ("get_default_program", None, ["none"], None),
    ("list_programs", (), ["no programs"], []),
    ("list_programs", ("a.rob", "程\x1b"), ["a.rob", "程\\x1b"], ["a.rob", "程\x1b"]),
    ("get_version", "1.0.0", ["1.0.0"], "1.0.0"),
    ("get_time", NOON, ["2014-12-22 14:30:00"], "2014-12-22T14:30:00"),
    ("get_analog_input", 100.0, ["100"], 100.0),
    ("get_analog_input", -0.25, ["-0.25"], -0.25),
    ("get_digital_inputs", "10000000", ["10000000  (ports 8 to 1)"], "10000000"),
    ("get_status", Status.of("00"), ["idle (00)"],
     {"state": "idle", "code": "00", "meaning": "idle", "joints": []}),
    ("get_status", Status.of("12"), ["error (12, motor fault: outer arm)"],
     {"state": "error", "code": "12", "meaning": "motor fault: outer arm",
      "joints": ["outer_arm"]}),
    ("get_gripper_center", Point(1, -2.5, 0), ["x  1 mm", "y  -2.5 mm", "z  0 mm"],
     {"x": 1, "y": -2.5, "z": 0}),
    ("get_joint_angles", JointValues(1.0, 2.0, 3.0, 4.0),
     ["inner_arm  1 °", "outer_arm  2 °", "wrist      3 mm", "rotation   4 °"],
     {"inner_arm": 1, "outer_arm": 2, "wrist": 3, "rotation": 4}),
    ("get_running_program", RunningProgram("a", 61), ["name        a", "run_time_s  61 s"],
     {"name": "a", "run_time_s": 61}),
    ("get_network", Network("1.1.1.1", "2.2.2.2", "3.3.3.3"),
     ["ip       1.1.1.1", "mask     2.2.2.2", "gateway  3.3.3.3"],
     {"ip": "1.1.1.1", "mask": "2.2.2.2", "gateway": "3.3.3.3"}),
    ("download", Path("a.rob"), ["a.rob"], "a.rob"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "result", "shown", "printed"), RESULTS)
def test_results_as_lines_and_as_json(
    name: str, result: Any, shown: list[str], printed: Any
) -> None:
    """Lines have units and no control characters; JSON is complete."""
    assert format_result(name, result) == shown
    assert json.loads(json.dumps(to_json(result))) == printed


@given(st.binary(min_size=1, max_size=30))
def test_names_are_shown_so_that_they_can_be_passed_again(data: bytes) -> None:
    """Each name has a text of its own, which is printable UTF-8 and parsed to the same bytes."""
    text = name_text(data.decode("utf-8", "surrogateescape"))
    assert text.isprintable()
    assert text.encode()
    assert parse_name(text) == data


def test_names_in_other_encodings() -> None:
    """A name in GBK is shown with its bytes, and how it reads; a name in UTF-8 as it is."""
    gbk, utf8 = "中.rob".encode("gbk"), "中.rob".encode()
    names = tuple(name.decode("utf-8", "surrogateescape") for name in (gbk, utf8, rb"a\xd6.rob"))
    assert format_result("list_programs", names) == [
        r"\xd6\xd0.rob  (GB18030: 中.rob)",
        "中.rob",
        r"a\\xd6.rob",
    ]
    assert to_json(names, name_text) == [r"\xd6\xd0.rob", "中.rob", r"a\\xd6.rob"]
    assert parse_arguments("delete_program", [r"\xd6\xd0.rob"]) == [gbk]
    local = r"C:\x41\a.rob"
    assert parse_arguments("upload", [local, r"\xd6\xd0.rob"]) == [local, gbk]


def test_undecodable_bytes() -> None:
    """T/8: lines show them escaped; the JSON of drivers keeps them unchanged."""
    (shown,) = format_result("get_default_program", "\udcb3\udccc")
    assert shown.isprintable()
    assert json.loads(json.dumps(to_json("\udcb3\udccc"))) == "\udcb3\udccc"


def test_errors_have_code_meaning_and_joints() -> None:
    """If the error has a code."""
    command = BY_NAME["reset"]
    assert error_to_json(Failed(command, TABLE_8_1["13"])) == {
        "kind": "Failed",
        "message": "reset failed: 13, motor fault: inner arm and outer arm",
        "code": "13",
        "meaning": "motor fault: inner arm and outer arm",
        "joints": ["inner_arm", "outer_arm"],
    }
    refused = error_to_json(Refused(BY_NAME["set_time"]))
    assert (refused["code"], refused["meaning"], refused["joints"]) == (None, None, [])
    assert error_to_json(LinkLost("gone")) == {"kind": "LinkLost", "message": "gone"}


def test_every_operation_names_its_parameters_once() -> None:
    """The command line lists them."""
    for takes in OPERATIONS.values():
        assert len(set(takes)) == len(takes)
