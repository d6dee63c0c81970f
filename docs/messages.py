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
from pathlib import Path
from typing import Final

import click
from babel.messages.catalog import Catalog, Message
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po, write_po

from scaraspec.cli.help import texts_of
from scaraspec.cli.main import COMMANDS, group
from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.protocol.readings import READINGS
from scaraspec.register import register
from scaraspec.report.model import Role
from scaraspec.report.texts import ALL_TEXTS
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.plan import Options
from scaraspec.translation import CLICK_DOMAIN, LOCALE

ROOT: Final = Path(__file__).resolve().parent.parent
FOLDER: Final = LOCALE / "zh" / "LC_MESSAGES"
_PACKAGE: Final = ROOT / "conformance/scaraspec"
_NO_DATE: Final = datetime(1970, 1, 1, tzinfo=UTC)
"""The date in the compiled catalogues, which depend on the translations only."""

_SOURCES: Final = {
    "cli": ("api", "certificate", "cli", "dissectors", "pytest_plugin", "results", "tables"),
    "judge": ("judge", "traffic"),
    "peers": ("client", "mutants/*.py", "transports", "virtual_controller"),
    "protocol": ("protocol",),
    "recorder": ("../../recorder/scaraspec_recorder",),
    "report": ("report",),
    "suite": ("suite",),
}
"""The packages of each catalogue."""

_MESSAGE_POSITIONS: Final = {
    "UserMessage": (0,),
    "localized": (0,),
    "joined": (0, 1),
    "expect": (1,),
    "expect_equal": (2,),
    "expect_in": (2,),
    "failed": (0,),
    "inconclusive": (0,),
    "tolerate": (2, 3),
    "tolerated": (2,),
}
"""Functions that take a message, and its positions."""

_ERROR: Final = re.compile(
    r"[A-Z]\w*(Error|Problem|Failed|Inconclusive|Skipped|Refused|Lost|Failure)"
)
_FOR_PROGRAMMERS: Final = {"AssertionError", "RuntimeError", "TypeError", "ValueError"}
_MESSAGE_NAMES: Final = {"message", "problem", "reason", "template", "text", "what", "why"}
"""Variables and parameters that contain a message."""


def messages() -> dict[str, list[str]]:
    """Return the messages of each catalogue in the order of the code, each message once."""
    found = {
        "click": [*_click_words().values()],
        "report": [*ALL_TEXTS],
        "readings": [*_readings()],
        "requirements": [requirement.sentence for requirement in REQUIREMENTS.values()],
        "cases": [*_case_titles()],
        "register": [*_register()],
        "cli": [*_help_texts()],
    }
    for domain, packages in _SOURCES.items():
        for package in packages:
            found.setdefault(domain, []).extend(_in_package(_PACKAGE / package))
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
    found = {}
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
            yield case.sentence


def _readings() -> Iterator[str]:
    for reading in READINGS.values():
        yield reading.question
        yield from (option.meaning for option in reading.options)


def _register() -> Iterator[str]:
    for entry in register().values():
        yield from (entry.title, entry.problem, entry.readings, entry.default, entry.tool_may_say)


def _in_package(path: Path) -> Iterator[str]:
    files = path.parent.glob(path.name) if path.suffix else path.rglob("*.py")
    for file in sorted(files):
        if "templates" not in file.parts and file.parent.name != "requirements":
            yield from _in_module(ast.parse(file.read_text("utf-8")))


def _in_module(module: ast.Module) -> Iterator[str]:
    for node in ast.walk(module):
        if isinstance(node, ast.Call):
            yield from _in_call(node)
        elif isinstance(node, ast.Assign | ast.AnnAssign) and node.value:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if any(_MESSAGE_NAMES & {getattr(each, "id", "")} for each in targets):
                yield from _sentences(node.value)


def _in_call(call: ast.Call) -> Iterator[str]:
    name = getattr(call.func, "id", None) or getattr(call.func, "attr", None) or ""
    positions = _MESSAGE_POSITIONS.get(name, ())
    explicit = name in ("UserMessage", "localized", "joined")
    for position in positions:
        for argument in call.args[position : position + 1]:
            yield from (_constants if explicit else _sentences)(argument)
    if name == "map" and getattr(call.args[0], "id", "") == "localized":
        yield from (text for each in getattr(call.args[1], "elts", ()) for text in _constants(each))
    if _ERROR.fullmatch(name) and name not in _FOR_PROGRAMMERS:
        for argument in call.args:
            yield from _sentences(argument)
    for keyword in call.keywords:
        if explicit or keyword.arg in _MESSAGE_NAMES:
            yield from _sentences(keyword.value)


def _constants(node: ast.expr) -> Iterator[str]:
    """Yield the strings that an expression may have as its value."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value:
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from _constants(node.body)
        yield from _constants(node.orelse)
    elif isinstance(node, ast.BoolOp):
        for value in node.values:
            yield from _constants(value)


def _sentences(node: ast.expr) -> Iterator[str]:
    """Yield those that are phrases, not names."""
    yield from (text for text in _constants(node) if re.search("[A-Za-z]{2}.* |[a-z] ", text))


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


if __name__ == "__main__":
    update()
