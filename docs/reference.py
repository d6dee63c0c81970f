"""Generate the reference pages of the site from the tables of the package.

Belongs here: one function per page, which returns Markdown. `docs.assemble` writes the pages.
"""

import itertools
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib.resources import files
from typing import Any, Final

import click

from scaraspec import api
from scaraspec.certificate.mandatory import mandatory_lists
from scaraspec.cli.main import COMMANDS as COMMAND_LINE
from scaraspec.cli.main import group
from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.mutants import client as client_mutants
from scaraspec.mutants import controller as controller_mutants
from scaraspec.protocol.commands import COMMANDS
from scaraspec.protocol.errors import TABLE_8_1
from scaraspec.protocol.payloads import Payload
from scaraspec.protocol.readings import READINGS
from scaraspec.report.model import Role
from scaraspec.suite.engine.case_sheet import case_sheets
from scaraspec.suite.engine.hooks import HOOKS

_MUTANTS: Final = {Role.CONTROLLER: controller_mutants, Role.CLIENT: client_mutants}


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield ""
    for cells in (head, ["---"] * len(head), *rows):
        yield "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
    yield ""


def _code(text: str) -> str:
    """Return text as code. Text in it has no meaning in Markdown or HTML."""
    return f"`{text}`" if text else ""


def _prose(text: str) -> str:
    """Return text in which no character has a meaning in Markdown or HTML."""
    for character in "\\`*_[]<>{}":
        text = text.replace(character, f"\\{character}")
    return text


def commands() -> Iterator[str]:
    """Yield the commands of the protocol, and the error codes."""
    yield from (
        "# Commands of the protocol",
        "",
        "This page has one section per command. The fields are in the order of the frame, with `|`",
        "between them. `done` is `1`, or `0` and a code. Lines are those of the",
        "[document](document.md). `scaraspec call URL NAME` sends a command.",
    )
    for row in COMMANDS:
        yield from (
            "",
            f"## 0x{row.opcode:02X} {row.name}",
            "",
            f"{row.title}（{row.original}）.",
            "",
        )
        parts = [("request", row.request), ("first reply", row.reply), ("final result", row.result)]
        yield from _table(
            ("message", "data", "fields"),
            [(name, _code(part.form), _fields(part)) for name, part in parts if part],
        )
        facts = [
            f"clause {row.clause}, lines {row.lines[0]} to {row.lines[1]}",
            f"hazard: {row.hazard.value}",
            f"the {row.initiator.name.lower()} direction starts it"
            if row.initiator is not COMMANDS[0].initiator
            else "",
            f"also printed as 0x{row.alternate_opcode:02X}" if row.alternate_opcode else "",
            f"the reply is also printed as 0x{row.alternate_reply_opcode:02X}"
            if row.alternate_reply_opcode
            else "",
            "its data is masked in decoded output" if row.secret else "",
        ]
        yield "\n".join(f"- {fact}" for fact in facts if fact)
    yield from ("", "## Error codes", "", "Table 8-1 of the document.")
    yield from _table(
        ("code", "meaning", "original", "line"),
        [
            (_code(code.text), code.meaning, code.original, f"{code.line}")
            for code in TABLE_8_1.values()
        ],
    )


def _fields(payload: Payload) -> str:
    return ", ".join(
        f"{_code(field.name)} ({field.unit})" if field.unit else _code(field.name)
        for field in payload.fields
    )


def readings() -> Iterator[str]:
    """Yield the readings of all open points."""
    yield from (
        "# Readings",
        "",
        "Each section is an open point of the document. A reading is claimed in `[readings]` of",
        'the ICS as `KEY = "OPTION"`. `controller` and `audit` take `--reading KEY=OPTION`.',
        "The first option is the default. The [register](register.md) has the reasons.",
    )
    for reading in READINGS.values():
        yield from (
            "",
            f"## {reading.key}",
            "",
            f"{_prose(reading.question)} Register entry {reading.entry}.",
        )
        detected = ", ".join(
            (part.name or "").lower().replace("_", " ") for part in reading.detectable
        )
        unit = f" A number with the unit {reading.unit} is allowed, too." if reading.unit else ""
        yield f"Binds: {reading.binds.value}. Detected: {detected or 'not from outside'}.{unit}"
        yield from _table(
            ("option", "meaning"),
            [(_code(option.name), _prose(option.meaning)) for option in reading.options],
        )


def cases(role: Role) -> Iterator[str]:
    """Yield the cases of a role by clause."""
    sheets = case_sheets(role)
    yield from (
        f"# Cases for a {role.value}",
        "",
        f"The suite has {len(sheets)} cases for a {role.value}. `scaraspec cases ID` prints the",
        "steps and the criteria of one case. `scaraspec cases --html specification.html` writes",
        "those of all cases.",
    )
    ordered = sorted(sheets, key=lambda sheet: list(REQUIREMENTS).index(sheet.case.requirements[0]))
    for clause, found in itertools.groupby(ordered, lambda sheet: sheet.case.id.partition("/")[0]):
        yield from ("", f"## Clause {clause}")
        yield from _table(
            ("case", "what it tries", "judges", "hazards", "hooks"),
            [
                (
                    _code(sheet.case.id) + (" slow" if sheet.case.slow else ""),
                    _prose(sheet.case.sentence),
                    ", ".join(sheet.case.requirements),
                    ", ".join(sorted(hazard.value for hazard in sheet.case.hazards)),
                    ", ".join(map(_code, sheet.case.needs)),
                )
                for sheet in found
            ],
        )


def mutants(role: Role) -> Iterator[str]:
    """Yield the mutants of a role by the first requirement that each violates."""
    known = sorted(
        _MUTANTS[role].mutants().values(),
        key=lambda mutant: list(REQUIREMENTS).index(mutant.requirements[0]),
    )
    yield from (
        f"# Faulty {role.value}s",
        "",
        f"There are {len(known)} mutants of the {role.value}. The suite kills each of them",
        "([how](../mutants.md)). A *subtle* fault appears late, at one size, or in one state.",
    )
    for clause, found in itertools.groupby(known, lambda m: m.requirements[0].partition("/")[0]):
        yield from ("", f"## Clause {clause}")
        yield from _table(
            ("mutant", "fault", "violates"),
            [
                (
                    _code(mutant.name) + (" subtle" if mutant.subtle else ""),
                    _prose(mutant.sentence),
                    ", ".join(mutant.requirements),
                )
                for mutant in found
            ],
        )


def hooks() -> Iterator[str]:
    """Yield the hooks of an ICS."""
    yield from (
        "# Hooks",
        "",
        "A hook is a command line in `[hooks]` of the [ICS](../certify-controller.md#ics-file). It",
        "operates the device. `--certification` needs those that are marked as necessary.",
    )
    optional = mandatory_lists(Role.CONTROLLER)[-1].optional_hooks
    yield from _table(
        ("hook", "what it does", "certification"),
        [
            (_code(name), f"It {_prose(text)}.", "" if name in optional else "necessary")
            for name, text in HOOKS.items()
        ],
    )


def results() -> Iterator[str]:
    """Yield the schema of results.json."""
    schema = json.loads(
        files("scaraspec.report").joinpath("results.schema.json").read_text("utf-8")
    )
    yield from (
        "# Schema of results.json",
        "",
        f"The schema is `{schema['title']}`. {schema['description']} The JSON schema is",
        "`scaraspec/report/results.schema.json` in the package. A key with * is always present.",
        "",
        "## Results",
    )
    yield from _properties(schema)
    for name, kind in schema["$defs"].items():
        yield from ("", f"## {name}", "", _prose(kind.get("description", "")))
        if "enum" in kind:
            yield from ("", "One of " + ", ".join(map(_code, kind["enum"])) + ".")
        else:
            yield from _properties(kind)


def _properties(kind: Mapping[str, Any]) -> Iterator[str]:
    required = kind.get("required", ())
    yield from _table(
        ("key", "type", "meaning"),
        [
            (_code(key) + "*" * (key in required), _type(each), _prose(each.get("description", "")))
            for key, each in kind.get("properties", {}).items()
        ],
    )


def _type(kind: Mapping[str, Any]) -> str:
    names = kind.get("type", "any")
    name = " or ".join(names) if isinstance(names, list) else str(names)
    match kind:
        case {"$ref": str(target)}:
            target = target.rpartition("/")[2]
            name = f"[{target}](#{target.lower()})"
        case {"anyOf": [*kinds]}:
            name = " or ".join(map(_type, kinds))
        case {"items": items}:
            name = f"array of {_type(items)}"
        case {"additionalProperties": dict(values)}:
            name = f"object of {_type(values)}"
        case {"const": constant}:
            name = _code(f"{constant}")
        case {"enum": [*values]}:
            name = " or ".join(_code(f"{value}") for value in values)
    return name


def command_line() -> Iterator[str]:
    """Yield the help of every command."""
    context = click.Context(group, info_name="scaraspec")
    yield from (
        "# Command line",
        "",
        "This page has the output of `--help` of every command.",
        "",
        "| exit status | meaning |",
        "|---|---|",
        "| 0 | conformant, or no violation found, or done |",
        "| 1 | nonconformant, refused or different |",
        "| 2 | usage or configuration error |",
        "| 3 | inconclusive, interrupted or incomplete, or something is left on the robot |",
        "| 4 | nothing was tested |",
        "",
        "The environment variables are `SCARASPEC_PASSWORD`, which replaces `--password`, and",
        "`SCARASPEC_STATE`, the folder of the [journal](../safety.md#journal).",
    )
    for name in COMMAND_LINE:
        command = group.get_command(context, name)
        assert command
        yield from _help(command, click.Context(command, context, info_name=name))


def _help(command: click.Command, context: click.Context) -> Iterator[str]:
    level = "#" * (1 + context.command_path.count(" "))
    yield from (
        "",
        f"{level} {context.command_path}",
        "",
        "```text",
        command.get_help(context),
        "```",
    )
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            assert below
            yield from _help(below, click.Context(below, context, info_name=name))


def python_api() -> Iterator[str]:
    """Yield the names of the Python interface; mkdocstrings inserts their docstrings."""
    yield from (
        "# Python API",
        "",
        "`scaraspec.api` has these names. [Use it from Python](../python.md) has examples.",
    )
    for name in api.__all__:
        if name == "certify":
            roles = Role.CONTROLLER.value, Role.CLIENT.value
            places = {f"certify.{role}": f"scaraspec.api.certify.{role}" for role in roles}
        else:
            places = {name: f"{getattr(api, name).__module__}.{name}"}
        for title, place in places.items():
            yield from ("", f"## {title}", "", f"::: {place}")
    yield from ("", "## Client", "", "::: scaraspec.client.blocking.Client")


PAGES: Final[Mapping[str, Callable[[], Iterator[str]]]] = {
    "commands.md": commands,
    "readings.md": readings,
    "cases-controller.md": lambda: cases(Role.CONTROLLER),
    "cases-client.md": lambda: cases(Role.CLIENT),
    "mutants-controller.md": lambda: mutants(Role.CONTROLLER),
    "mutants-client.md": lambda: mutants(Role.CLIENT),
    "hooks.md": hooks,
    "results.md": results,
    "command-line.md": command_line,
    "python-api.md": python_api,
}
"""File name in the folder `reference` of the site, and the function that yields its lines."""
