"""Conversion between plain values and typed ones, with positions in errors."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import pytest

from scaraspec.report.codec import InvalidValueError, from_plain, to_plain
from scaraspec.user_message import UserMessage


class Colour(Enum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True)
class Inner:
    number: int
    share: float = 0.5


@dataclass(frozen=True)
class Outer:
    name: str
    colour: Colour
    inner: Inner | None = None
    pairs: tuple[tuple[str, int], ...] = ()
    by_colour: Mapping[Colour, bool] = field(default_factory=dict)


WHOLE = Outer("x", Colour.RED, Inner(3, 0.25), (("a", 1), ("b", 2)), {Colour.BLUE: True})


def test_round_trip() -> None:
    """A value with every type of member is converted back unchanged."""
    plain = to_plain(WHOLE)
    assert plain == {
        "name": "x",
        "colour": "red",
        "inner": {"number": 3, "share": 0.25},
        "pairs": [["a", 1], ["b", 2]],
        "by_colour": {"blue": True},
    }
    assert from_plain(Outer, plain) == WHOLE


def test_missing_and_unknown_keys() -> None:
    """Defaults are used, unknown keys are ignored: files of older and newer versions are read."""
    assert from_plain(Outer, {"name": "x", "colour": "red", "later": 1}) == Outer("x", Colour.RED)


def test_an_integer_is_accepted_as_float() -> None:
    """JSON writers may omit the fraction of 1.0."""
    assert from_plain(Inner, {"number": 1, "share": 1}) == Inner(1, 1.0)


@pytest.mark.parametrize(
    ("change", "printed"),
    [
        ({"name": None}, "name is None, not a string"),
        ({"colour": "green"}, "colour is 'green', not one of red, blue"),
        ({"inner": {}}, "inner.number is missing"),
        ({"inner": {"number": True}}, "inner.number is True, not an integer"),
        ({"inner": {"number": 1.5}}, "inner.number is 1.5, not an integer"),
        ({"inner": {"number": 2**63}}, "inner.number does not fit 64 bits"),
        ({"inner": {"number": 1, "share": float("inf")}}, "inner.share is not a finite number"),
        ({"inner": {"number": 1, "share": 10**400}}, "inner.share does not fit 64 bits"),
        ({"inner": []}, "inner is [], not an object"),
        ({"pairs": {}}, "pairs is {}, not an array"),
        ({"pairs": [["a"]]}, "pairs[0] has 1 items, not 2"),
        ({"pairs": [["a", 1], ["b", "c"]]}, "pairs[1][1] is 'c', not an integer"),
        ({"by_colour": {"red": 0}}, "by_colour.red is 0, not true or false"),
        ({"by_colour": {"\x1b": True}}, "a key of by_colour is '\\x1b', not one of red, blue"),
    ],
)
def test_invalid_values(change: dict[str, Any], printed: str) -> None:
    """The message has the position of the value."""
    with pytest.raises(InvalidValueError) as caught:
        from_plain(Outer, {"name": "x", "colour": "red"} | change)
    assert str(caught.value) == printed


def test_an_invalid_document() -> None:
    """The message names the whole document."""
    with pytest.raises(InvalidValueError, match="the document is 3, not an object"):
        from_plain(Outer, 3)


def test_user_messages_keep_their_values() -> None:
    """A message is read with its template and values; damaged ones are errors with a position."""
    message = UserMessage("the code is {code}", code="07")
    plain = json.loads(json.dumps(to_plain(replace(WHOLE, name=message))))
    read = from_plain(Outer, plain)
    assert isinstance(read.name, UserMessage)
    assert (read.name, read.name.template, read.name.values) == (
        *("the code is 07", "the code is {code}", {"code": "07"}),
    )
    assert to_plain(read) == plain
    for key, value in (("name_template", 3), ("name_values", ["07"]), ("name_values", {"code": 7})):
        with pytest.raises(InvalidValueError, match=key):
            from_plain(Outer, {**plain, key: value})
