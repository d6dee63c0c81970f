"""The messages that are translated, by catalogue; run by `make messages`, which updates them.

A message is a template or a constant sentence in the code, a help text, a text of the report, the
title of a case, a requirement, or a reading. docs/translation.md describes how to translate them.
"""

import ast
import importlib
import inspect
import re
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Final

import click
from babel.messages.catalog import Catalog, Message
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po, write_po

from scaraspec.certificate.decisions import Consequence, decisions
from scaraspec.cli.help import texts_of
from scaraspec.cli.main import COMMANDS, group
from scaraspec.judge.requirements import REQUIREMENTS, Binds, Strength
from scaraspec.mutants import client, controller
from scaraspec.protocol.frames import SkipReason
from scaraspec.protocol.program_files import Severity
from scaraspec.protocol.readings import READINGS
from scaraspec.register import register
from scaraspec.report.model import Role
from scaraspec.report.texts import ALL_TEXTS
from scaraspec.suite.engine.case_sheet import case_sheets
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.plan import Options
from scaraspec.translation import CLICK_DOMAIN, LOCALE
from scaraspec.user_message import UserMessage

ROOT: Final = Path(__file__).resolve().parent.parent
PAGE: Final = ROOT / "docs/translation.md"
_SAMPLES: Final = "## Samples for review\n"
_SAMPLE_COUNT: Final = 20
_MARKUP: Final = re.compile(r"[\\\\|*_`<\[\]]")
FOLDER: Final = LOCALE / "zh" / "LC_MESSAGES"
_PACKAGE: Final = ROOT / "conformance/scaraspec"
_NO_DATE: Final = datetime(1970, 1, 1, tzinfo=UTC)
"""The date in the compiled catalogues, which depend on the translations only."""

_SOURCES: Final = {
    "cli": (
        *("api", "certificate", "cli", "dissectors", "pytest_plugin", "results", "tables"),
        "user_message.py",
    ),
    "judge": ("judge", "traffic"),
    "peers": ("client", "mutants/*.py", "transports", "virtual_controller"),
    "protocol": ("protocol",),
    "recorder": ("../../recorder/scaraspec_recorder",),
    "report": ("report",),
    "suite": ("suite",),
}
"""The packages of each catalogue."""

_NOT_SHOWN: Final = (
    "dissectors",  # texts in Wireshark and scapy
    "ics_proforma.py",  # comments of a file
    "metrics.py",  # read by programs
    "mutants",
    "requirements",  # have their own domain
    "rerun",  # texts in the viewer
    "schema.py",
    "schemas",
    "templates",
    "texts.py",
)
"""Files and folders whose texts no command displays, except those that are marked."""

_EXPLICIT: Final = ("UserMessage", "joined", "localized")
"""Functions whose strings are messages, even if they are single words."""

_ENGLISH: Final = frozenset(
    {
        *("AssertionError", "RuntimeError", "TypeError", "ValueError"),  # for programmers
        *("debug", "error", "exception", "info", "log", "warning"),  # logs
        *("argument", "command", "group", "option", "password_option", "Word"),  # help
        *("Reading", "Option"),  # have their own domain
        *("addini", "addinivalue_line", "getgroup"),  # pytest
    }
)
"""Functions whose strings stay English, or are collected elsewhere."""

_PHRASE: Final = re.compile(r"[a-z]{2}[,;:.)'\"]* [\w{('=-]|\} [a-z]{2}|[A-Za-z]{2} \{|\d [a-z]{3}")
_QUOTED: Final = re.compile("「.*?」|`.*?`", re.DOTALL)
_NAMES: Final = re.compile(r"\{[^}]*\}|b?'.*?'")
_WORDS: Final = re.compile(r"\b[a-z]{2}")
"""English words outside of the quotations of the document."""
_NO_PHRASE: Final = re.compile(
    r"^\s*(?:<|bold |Example: |SELECT |CREATE |\x08|# |\\|\")|%[a-z]|\[bold\]"
)


@cache
def messages() -> dict[str, list[str]]:
    """Return the messages of each catalogue in the order of the code, each message once."""
    found = {
        "click": [*_click_words().values()],
        "report": [*ALL_TEXTS],
        "readings": [*_readings()],
        "requirements": [*_requirements()],
        "cases": [*_case_titles()],
        "mutants": [*_mutant_sentences()],
        "register": [*_register()],
        "cli": [*_help_texts()],
        "protocol": [each.value for each in (*SkipReason, *Severity)],
    }
    for domain, packages in _SOURCES.items():
        for package in packages:
            found.setdefault(domain, []).extend(_in_package(_PACKAGE / package))
    found["suite"].extend(_criteria())
    seen: set[str] = set()
    result: dict[str, list[str]] = {}
    for domain, texts in found.items():
        known = set() if domain == CLICK_DOMAIN else seen
        result[domain] = [text for text in dict.fromkeys(texts) if text not in known]
        known.update(texts)
    return result


def _help_texts() -> Iterator[str]:
    """Yield the help texts of all commands."""
    yield from COMMANDS.values()
    yield from _texts_below(group)


def _texts_below(command: click.Command) -> Iterator[str]:
    yield from texts_of(command)
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            assert below
            yield from _texts_below(below)


def _click_words() -> dict[str, str]:
    """Return the words of click itself; the plural by the singular, which may be the same."""
    found = {"required": "required"}  # the only one that is not marked in its code
    for name in ("core", "decorators", "exceptions", "formatting", "parser", "termui", "types"):
        module = importlib.import_module(f"click.{name}")
        for node in ast.walk(ast.parse(inspect.getsource(module))):
            function = getattr(getattr(node, "func", None), "id", "")
            if isinstance(node, ast.Call) and function in ("_", "ngettext"):
                texts = [text for argument in node.args for text in _constants(argument)]
                found.update({texts[0]: texts[-1]} if texts else {})
    return found


def _case_titles() -> Iterator[str]:
    for role in (Role.CONTROLLER, Role.CLIENT):
        for case in collect(Options(), role):
            yield from case.paragraphs
    yield from (each.value for each in Consequence)
    for decision in decisions():
        yield from (decision.question, decision.decision)


def _requirements() -> Iterator[str]:
    for requirement in REQUIREMENTS.values():
        yield requirement.sentence
    yield from (each.value for each in (*Strength, *Binds))


def _criteria() -> Iterator[str]:
    """Yield what fails the cases, as the test specification has it."""
    for role in (Role.CONTROLLER, Role.CLIENT):
        for sheet in case_sheets(role):
            yield from (text for each in sheet.criteria for text in _criterion(each))


def _criterion(criterion: str) -> Iterator[str]:
    """Yield the parts of a criterion that have English words; those of one in braces are names."""
    values = criterion.values.values() if isinstance(criterion, UserMessage) else (criterion,)
    yield from (text for text in values if _WORDS.search(_NAMES.sub("", text)))


def _mutant_sentences() -> Iterator[str]:
    for package in (controller, client):
        yield from (mutant.sentence for mutant in package.mutants().values())


def _readings() -> Iterator[str]:
    for reading in READINGS.values():
        yield reading.question
        yield from (option.meaning for option in reading.options)


def _register() -> Iterator[str]:
    for entry in register().values():
        yield from (entry.title, entry.problem, entry.readings, entry.default, entry.tool_may_say)
        for text in (entry.verdict, entry.where, entry.says):
            if _WORDS.search(_QUOTED.sub("", text)):
                yield text


def _in_package(path: Path) -> Iterator[str]:
    files = path.parent.glob(path.name) if path.suffix else path.rglob("*.py")
    for file in sorted(files):
        phrases = not {*file.relative_to(path.parent).parts} & {*_NOT_SHOWN}
        yield from _in_code(ast.parse(file.read_text("utf-8")), phrases=phrases)


def _in_code(node: ast.AST, *, phrases: bool) -> Iterator[str]:
    """Yield the messages of a part of the code: phrases, and all strings that are marked."""
    if isinstance(node, ast.Constant):
        if phrases and isinstance(node.value, str) and _is_phrase(node.value):
            yield node.value
        return
    if _is_docstring(node):
        return
    parts = ast.iter_child_nodes(node)
    if isinstance(node, ast.JoinedStr):
        parts = (part for part in parts if isinstance(part, ast.FormattedValue))
    if isinstance(node, ast.Call):
        name = _name_of(node.func)
        if name in _EXPLICIT or (name == "map" and _name_of(node.args[0]) in _EXPLICIT):
            yield from (text for argument in node.args for text in _constants(argument))
        elif name in _ENGLISH:
            parts = (part for part in parts if isinstance(part, ast.Call))
    for part in parts:
        yield from _in_code(part, phrases=phrases)


def _name_of(node: ast.expr) -> str:
    """Return the name of a function or a method."""
    return getattr(node, "id", "") or getattr(node, "attr", "")


def _is_phrase(text: str) -> bool:
    """Whether a string is more than a name."""
    return bool(_PHRASE.search(text)) and not _NO_PHRASE.search(text)


def _is_docstring(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _constants(node: ast.expr) -> Iterator[str]:
    """Yield the strings that an expression may have as its value."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value:
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from _constants(node.body)
        yield from _constants(node.orelse)
    elif isinstance(node, ast.BoolOp | ast.Tuple):
        for value in node.values if isinstance(node, ast.BoolOp) else node.elts:
            yield from _constants(value)


def catalogue_file(domain: str) -> Path:
    """Return the file of a catalogue."""
    return FOLDER / f"{domain}.po"


def read(domain: str) -> dict[str, str]:
    """Return the translations of a catalogue by message; empty strings for those that are open."""
    file = catalogue_file(domain)
    if not file.exists():
        return {}
    with file.open("rb") as stream:
        return dict(_translation(message) for message in read_po(stream, "zh") if message.id)


def _translation(message: Message) -> tuple[str, str]:
    """Return a message and its translation; of one that depends on a number, the plural."""
    if isinstance(message.id, tuple):
        return message.id[-1], next(iter(message.string or ()), "")
    return f"{message.id}", f"{message.string}"


def write(domain: str, translations: Mapping[str, str]) -> None:
    """Write a catalogue, and compile it."""
    singular = {plural: text for text, plural in _click_words().items() if text != plural}
    catalogue = Catalog("zh", creation_date=_NO_DATE, revision_date=_NO_DATE, fuzzy=False)
    for text, chinese in translations.items():
        if domain == CLICK_DOMAIN and text in singular:
            catalogue.add((singular[text], text), (chinese,))
        else:
            catalogue.add(text, chinese)
    with catalogue_file(domain).open("wb") as stream:
        write_po(stream, catalogue, width=0, omit_header=True)
    with catalogue_file(domain).with_suffix(".mo").open("wb") as stream:
        write_mo(stream, catalogue)


def update() -> None:
    """Bring the catalogues up to date with the code, and compile them."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for domain, texts in messages().items():
        earlier = read(domain)
        write(domain, {text: earlier.get(text, "") for text in texts})
    PAGE.write_text(page(), encoding="utf-8")


def page() -> str:
    """Return docs/translation.md with samples of the present translations."""
    explanation, heading, _ = PAGE.read_text("utf-8").partition(_SAMPLES)
    return explanation + heading + "".join(map(_samples, sorted(messages())))


def _samples(domain: str) -> str:
    """Return a table of translations that are evenly spread over a catalogue."""
    translations = read(domain)
    known = [(text, chinese) for text, chinese in translations.items() if chinese]
    chosen = known[:: len(known) // _SAMPLE_COUNT + 1]
    rows = "".join(f"| {_cell(text)} | {_cell(chinese)} |\n" for text, chinese in chosen)
    table = f"\n| English | 中文 |\n|---|---|\n{rows}" if rows else ""
    return f"\n### {domain}: {len(known)} of {len(translations)} messages\n{table}"


def _cell(text: str) -> str:
    """Return text for a cell of a table: what looks like markup is shown as it is."""
    return _MARKUP.sub(r"\\\g<0>", " ".join(text.split()))


if __name__ == "__main__":
    update()
