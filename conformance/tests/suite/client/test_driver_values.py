"""Reported values are accepted in every form that the driver protocol allows, and in no other."""

from datetime import datetime, timedelta
from typing import Any

import pytest

from scaraspec.protocol.commands import JointValues, Network, RunningProgram
from scaraspec.protocol.payloads import NameListPart
from scaraspec.suite.client.harness.driver_values import expected_value, matches

POINT = {"x": 1.5, "y": -2, "z": 0}
NOON = datetime(2014, 12, 22, 12, 0)  # noqa: DTZ001 - the document names no zone
RUN_TIME = timedelta(days=1, seconds=3661)


@pytest.mark.parametrize(
    ("reported", "expected"),
    [
        ("00", "00"),
        (20, 20.0),
        (200.10000610351562, 200.1),
        (POINT, POINT),
        ([1.5, -2, 0.0], POINT),
        ({"X": 1.5, "Y": -2.0, "Z": 0}, POINT),
        (POINT | {"unit": "mm"}, POINT),
        (["a", "b"], ["a", "b"]),
        ("20141222120000", NOON),
        ("2014-12-22T12:00:00", NOON),
        (90061, RUN_TIME),
        ("01010101", RUN_TIME),
        (None, None),
        ("", None),
        ({"name": "", "run_time_s": 0}, None),
    ],
)
def test_equal_values(reported: Any, expected: Any) -> None:
    """Records by name or in order, numbers of either type, and times in either form match."""
    assert matches(reported, expected)


@pytest.mark.parametrize(
    ("reported", "expected"),
    [
        ("0", "00"),
        ("20", 20),
        (True, 1),
        (None, 0),
        (20.1, 20.0),
        ([1.5, -2], POINT),
        ([-2, 1.5, 0], POINT),
        (POINT | {"x": -1.5}, POINT),
        (["b", "a"], ["a", "b"]),
        (["a", "b", ""], ["a", "b"]),
        ("a|b", ["a", "b"]),
        ("20141222000000", NOON),
        (3661, RUN_TIME),
        ("00010101", RUN_TIME),
        ("0", None),
        ({"name": "a.rob", "run_time_s": 0}, None),
    ],
)
def test_different_values(reported: Any, expected: Any) -> None:
    """Other values, other orders and other types do not match."""
    assert not matches(reported, expected)


@pytest.mark.parametrize(
    ("value", "reported"),
    [
        (b"a.rob", "a.rob"),
        (b"", None),
        ("00", "00"),
        (None, None),
        (NameListPart(more=False, names=(b"a", b"b")), ["a", "b"]),
        (RunningProgram(b"a.rob", 90061), {"name": "a.rob", "run_time_s": RUN_TIME}),
        (
            Network("1.1.1.1", "255.0.0.0", "1.1.1.2"),
            {"ip": "1.1.1.1", "mask": "255.0.0.0", "gateway": "1.1.1.2"},
        ),
        (
            JointValues(20, 38.5, -4, 0),
            {"inner_arm": 20, "outer_arm": 38.5, "wrist": -4, "rotation": 0},
        ),
    ],
)
def test_values_as_json(value: Any, reported: Any) -> None:
    """A value of the command table is converted to JSON. Durations keep their type."""
    assert expected_value(value) == reported
    if reported is not None:
        assert matches(
            reported if not isinstance(value, RunningProgram) else ["a.rob", 90061], reported
        )
