"""ICS proforma: a statement with every question, to fill in (ISO/IEC 9646).

What is not answered is a comment, so that each proforma is a valid ICS.
"""

import json
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from typing import Final

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.readings import READINGS, Binds, Reading
from scaraspec.report.model import Tool
from scaraspec.report.sanitizing import visible
from scaraspec.suite.engine.hooks import HOOKS
from scaraspec.suite.engine.ics import LABORATORY, SAMPLE, Motion

_NS: Final = 1e9
_WIDTH: Final = 100
_SUBJECT: Final = {
    "name": "the name of the product",
    "version": "the version of the build that is tested",
    "url": "the link, such as tcp://192.168.1.2; used if the command line names none",
}
_MOTION: Final = {
    "step_mm": "the length of a move from the current pose, along one axis",
    "speed_percent": "the speed of a move",
    "box_mm": "the minimum and maximum of x, y and z, such as [[200, 300], [-50, 50], [200, 250]]",
    "jog_s": "the longest jog, in seconds",
    "longest_s": "the longest move, reset or program, in seconds of the subject",
}
_BINDS: Final = {
    Binds.CONTROLLER: "controller",
    Binds.CLIENT: "client",
    Binds.BOTH: "controller and client",
}


@dataclass(frozen=True, slots=True)
class Answers:
    """What queries have shown about a controller.

    Attributes:
        url: Its link.
        time_ns: When it was asked, in nanoseconds since the Unix epoch.
        version: The version that it reports; empty if it reports none.
        readings: The observed options by key, the most frequent first.
        unanswered: The queries without a reply.
    """

    url: str
    time_ns: int
    version: str = ""
    readings: Mapping[str, Sequence[str]] = field(default_factory=dict)
    unanswered: Sequence[str] = ()


def proforma(answers: Answers | None = None) -> str:
    """Return an ICS as TOML with every question, filled in as far as the answers are known."""
    return "\n".join(_lines(answers)) + "\n"


def _lines(answers: Answers | None) -> Iterator[str]:
    yield from _comment(
        f"Implementation conformance statement for scaraspec {Tool.own().version}. A key after # "
        "is a question that is not answered. Remove the # to answer it. Each claim is verified, "
        "and a wrong claim is a failure. `scaraspec ics check FILE` finds contradictions."
    )
    if answers:
        time = datetime.fromtimestamp(answers.time_ns / _NS, UTC).isoformat(timespec="seconds")
        yield from _comment(
            f"Filled in from {answers.url} at {time} with a login and queries; nothing was changed."
        )
    yield from ("", "[subject]")
    known = {"version": answers.version, "url": answers.url} if answers else {}
    for key, question in _SUBJECT.items():
        yield from _question(key, question, known.get(key, ""))
    yield from _comment(f"The commands that are not supported, from: {', '.join(BY_NAME)}.")
    if answers and answers.unanswered:
        yield from _comment(
            f"No reply was seen to {', '.join(answers.unanswered)}: name in lacks what is "
            "unsupported."
        )
    yield "# lacks = []"
    yield from _comment('When 0x05 takes effect: "at-once" or "after-restart".')
    yield '# network_applies = "at-once"'
    yield from _comment("How many seconds of the clock of the subject pass in one second.")
    yield "# time_scale = 1"
    yield from ("", "# The device that is tested.", "[sample]")
    yield from (f'# {key} = ""' for key in SAMPLE)
    yield from ("", "# Who tests it.", "[laboratory]")
    yield from (f'# {key} = ""' for key in LABORATORY)
    yield ""
    yield from _comment(
        "Open points of the document. `scaraspec requirements --entry A-0-9` explains one."
    )
    yield "[readings]"
    for reading in READINGS.values():
        yield from _reading(reading, answers.readings.get(reading.key, ()) if answers else ())
    yield from ("", "# How far the arm may be moved.", "[motion]")
    for each in fields(Motion):
        yield from _comment(f"{each.name}: {_MOTION[each.name]}")
        default = each.default if isinstance(each.default, int | float) else "[]"
        yield f"# {each.name} = {default}"
    yield from ("", "# Commands that operate the subject, run without a shell.", "[hooks]")
    yield "# timeout_s = 30"
    for hook, does in HOOKS.items():
        yield from _question(hook, does)


def _question(key: str, question: str, answer: str = "") -> Iterator[str]:
    yield from _comment(f"{key}: {question}")
    yield f"{key} = {_string(answer)}" if answer else f'# {key} = ""'


def _reading(reading: Reading, observed: Sequence[str]) -> Iterator[str]:
    yield ""
    yield from _comment(f"{reading.entry}, {_BINDS[reading.binds]}: {reading.question}")
    for option in reading.options:
        default = " (default)" if option.name == reading.default else ""
        yield from _comment(f"{_string(option.name)}{default}: {option.meaning}", indent="  ")
    if reading.unit:
        yield from _comment("or any positive number of seconds", indent="  ")
    if len(observed) == 1:
        yield f"{reading.key} = {_string(observed[0])}  # observed"
        return
    if observed:
        yield from _comment(f"Observed were {' and '.join(observed)}.")
    yield f"# {reading.key} = {_string(reading.default)}"


def _comment(text: str, *, indent: str = "") -> Iterator[str]:
    start = f"# {indent}"
    yield from textwrap.wrap(
        visible(text), _WIDTH, initial_indent=start, subsequent_indent=start, break_long_words=False
    )


def _string(text: str) -> str:
    """Return a text as a string of TOML."""
    return json.dumps(" ".join(visible(text).split()), ensure_ascii=False)
