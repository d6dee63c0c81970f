"""Reproduction of a failure: its last steps in words, and a script that repeats them.

The script is one Python file that needs nothing else, because the manufacturer of a controller may
not have scaraspec. It sends the recorded requests again and compares the last reply.
"""

import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from pprint import pformat
from typing import Final

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import TAG, Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.evidence import HIDDEN_VALUE
from scaraspec.report.files import write_whole
from scaraspec.report.model import Case, Evidence, Results, Role
from scaraspec.report.sanitizing import visible
from scaraspec.user_message import UserMessage

FOLDER: Final = "reproduce"
"""The folder of the scripts, beside results.json."""

_DATA: Final = re.compile(r"# data begins\n.*# data ends\n", re.DOTALL)
_PASSWORDS: Final = ("4.1/", "4.2/")
"""The clauses whose cases use several passwords."""

_LOGIN: Final = "login, request"
_FRAME_PARTS: Final = frozenset({"start", "tag", "opcode", "length", "end"})
_EFFECTS: Final = {
    Hazard.READ_ONLY: "",
    Hazard.STATE: "It may change settings or files, and does not restore them.",
    Hazard.MOTION: "IT MOVES THE ROBOT.",
    Hazard.DESTRUCTIVE: "IT MAY MOVE THE ROBOT, DELETE FILES OR SHUT THE ROBOT DOWN.",
}


def steps(case: Case) -> list[str]:
    """Return the last steps of a case in words, one for each piece of evidence."""
    return [_step(evidence) for evidence in case.wire]


def _step(evidence: Evidence) -> str:
    values = [
        f"{field.name} {field.value}"
        for field in evidence.fields
        if field.name not in _FRAME_PARTS and field.value
    ]
    what = ": ".join(filter(None, (evidence.note or "bytes", ", ".join(values))))
    template = (
        "connection {connection}: the client sends {what}"
        if evidence.direction is A2C
        else "connection {connection}: the controller sends {what}"
    )
    return UserMessage(template, connection=visible(evidence.connection), what=visible(what))


def script_path(case: Case, results: Results) -> str:
    """Return the path of the script of a failed case, relative to the results.

    It is empty if there is none: for a client, for a link other than TCP, and for steps that cannot
    be sent again, because their bytes are secret or were not stored.
    """
    repeatable = (
        case.verdict is Verdict.FAIL
        and results.role is Role.CONTROLLER
        and results.subject.link.startswith("tcp://")
        and not any(requirement.startswith(_PASSWORDS) for requirement in case.requirements)
        and any(evidence.direction is A2C for evidence in case.wire)
        and all(map(_is_stored, case.wire))
    )
    return f"{FOLDER}/{re.sub(r'[^A-Za-z0-9.-]', '-', case.id)}.py" if repeatable else ""


def script(case: Case) -> str:
    """Return a Python script that repeats the last steps of a case."""
    repeated = list(_repeated(case))
    decisive = [n for n, e in enumerate(repeated) if _frame_text(e) == case.observed]
    data = {
        "CASE": f"{case.id}: {visible(case.title)}",
        "PROBLEM": visible(case.message),
        "EXPECTED": visible(case.expected),
        "OBSERVED": visible(case.observed),
        "EFFECT": _EFFECTS[_hazard(case)],
        "WITH_ALL_STEPS": case.replay,
        "STEPS": [
            (e.connection, e.direction.value, _LOGIN if e.note == _LOGIN else _step(e), e.frame_hex)
            for e in repeated[: decisive[-1] + 1 if decisive else None]
        ],
    }
    lines = [f"{name} = {pformat(value, width=96)}\n" for name, value in data.items()]
    template = files("scaraspec.report").joinpath("templates/reproduction.py").read_text("utf-8")
    return _DATA.sub(lambda _: "".join(lines), template)


def _hazard(case: Case) -> Hazard:
    """The worst effect of the case and of its requests; bytes of no command may have any effect.

    A finding of the judge has no hazard, but the traffic that shows it may move the robot.
    """
    requests = (e.note.partition(",")[0] for e in case.wire if e.direction is A2C)
    commands = [BY_NAME.get(name) for name in requests]
    hazards = {case.hazard, *(c.hazard if c else Hazard.DESTRUCTIVE for c in commands)}
    return max(hazards, key=[*Hazard].index)


def _repeated(case: Case) -> Iterator[Evidence]:
    """Yield the steps, without replies to requests that are too old to be among them."""
    opened = set()
    for evidence in case.wire:
        if evidence.direction is A2C:
            opened.add(evidence.connection)
        if evidence.connection in opened:
            yield evidence


def _frame_text(evidence: Evidence) -> str:
    """Return a frame as the results show it, such as ``C2A 09 [30 30]``."""
    data = bytes.fromhex(evidence.frame_hex)
    tagged = data[1:2] == bytes([TAG])
    opcode, content = data[1 + tagged : 2 + tagged], data[3 + tagged : -1]
    return f"{Frame(evidence.direction, opcode[0], content, tagged)}" if opcode else ""


def _is_stored(evidence: Evidence) -> bool:
    """Whether all bytes of a piece of evidence are known; those of a login need not be."""
    data = bytes.fromhex(evidence.frame_hex)
    masked = not evidence.fields and b"*" in data
    secret = any(field.value == HIDDEN_VALUE for field in evidence.fields)
    return (
        len(data) == evidence.length_bytes
        and not masked
        and (evidence.note == _LOGIN or not secret)
    )


def write(results: Results, folder: Path) -> None:
    """Write the scripts of all failures into a folder, which is created if there are any.

    Raises:
        OSError: A file cannot be written, or the folder exists already.
    """
    paths = {path: case for case in results.cases if (path := script_path(case, results))}
    if paths:
        folder.mkdir()
    for path, case in paths.items():
        write_whole(folder.parent / path, script(case))
