"""Every message has a translation, and commands display it; what programs read stays English."""

import ast
import importlib.util
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from string import Formatter
from types import ModuleType

import pytest
from wording import ROOT

from scaraspec.translation import Language, preferred_language, translate
from scaraspec.user_message import UserMessage

COMPLETE = (
    *("cases", "cli", "click", "judge", "mutants", "peers", "protocol", "readings", "recorder"),
    *("register", "report", "requirements", "suite"),
)
"""The catalogues in which no translation is missing."""

_CHINESE = re.compile("[\u4e00-\u9fff]")


@pytest.fixture(scope="module")
def messages() -> ModuleType:
    """Return the script that collects the messages."""
    found = importlib.util.spec_from_file_location("messages", ROOT / "docs/messages.py")
    assert found
    assert found.loader
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def test_catalogues_have_the_messages_of_the_code(messages: ModuleType) -> None:
    """A new message is in its catalogue, and no catalogue has an old one; else `make messages`."""
    expected = messages.messages()
    assert {file.stem for file in messages.FOLDER.glob("*.po")} == expected.keys()
    for domain, texts in expected.items():
        assert [*messages.read(domain)] == texts, domain


def test_no_translation_is_missing(messages: ModuleType) -> None:
    """Each message of a complete catalogue has a translation."""
    for domain in COMPLETE:
        assert [text for text, chinese in messages.read(domain).items() if not chinese] == [], (
            domain
        )


def test_placeholders_agree(messages: ModuleType) -> None:
    """A translation has the replacement fields of its message, with the same formats."""
    for domain in messages.messages():
        for text, chinese in messages.read(domain).items():
            if chinese and _fields(text):
                assert _fields(chinese) == _fields(text), text


def _fields(template: str) -> list[tuple[str, str, str]]:
    """Return the fields of a template; none if it is a sentence with braces."""
    try:
        parts = Formatter().parse(template)
        return sorted((name, form or "", how or "") for _, name, form, how in parts if name)
    except ValueError:
        return []


def test_translations_are_compiled(messages: ModuleType) -> None:
    """What commands read is what the catalogues contain; else `make messages`."""
    for domain in messages.messages():
        if domain != "click":
            for text, chinese in messages.read(domain).items():
                assert translate(text, Language.CHINESE) == (chinese or text)


def test_a_message_keeps_its_values() -> None:
    """Values are formatted as in English; those that are messages are translated, too."""
    message = UserMessage("{judged:g} of {total}", judged=1.50, total=3)
    assert translate(message, Language.CHINESE) == "1.5 of 3"  # it has no translation
    inner = UserMessage("{count} times", count=3)
    outer = UserMessage.joined("a message without translation", " ({times})", times=inner)
    assert translate(outer, Language.CHINESE) == outer
    known = UserMessage.joined(
        "nothing was tested: no requirement could be judged", " ({times})", times=inner
    )
    assert translate(known, Language.CHINESE).endswith("（3 次）")
    assert translate(known, Language.ENGLISH) == f"{known}"


@pytest.mark.parametrize(
    ("variables", "language"),
    [
        ({"SCARASPEC_LANGUAGE": "zh", "LANG": "en_US.UTF-8"}, Language.CHINESE),
        ({"SCARASPEC_LANGUAGE": "en", "LANG": "zh_CN.UTF-8"}, Language.ENGLISH),
        ({"LANG": "zh_CN.UTF-8"}, Language.CHINESE),
        ({"LC_ALL": "C", "LANG": "zh_CN.UTF-8"}, Language.ENGLISH),
        ({"LC_ALL": "", "LC_MESSAGES": "zh_TW", "LANG": "de_DE"}, Language.CHINESE),
        ({}, Language.ENGLISH),
    ],
)
def test_the_environment_selects_the_language(
    monkeypatch: pytest.MonkeyPatch, variables: dict[str, str], language: Language
) -> None:
    """The variable of scaraspec is first; then the order of gettext."""
    for name in ("SCARASPEC_LANGUAGE", "LC_ALL", "LC_MESSAGES", "LANG"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert preferred_language() is language


def _run(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "scaraspec", *arguments],
        capture_output=True,
        check=False,
        encoding="utf-8",
        env={**os.environ, "PYTHONUTF8": "1", **variables},
    )


def test_help_is_in_the_language_of_the_option() -> None:
    """Texts, headings and the words of click are Chinese; no line is too wide."""
    for arguments in (
        ("--language", "zh", "--help"),
        ("--language", "zh", "certify", "controller", "--help"),
        ("--language", "zh", "program", "--help"),
        ("--language", "zh", "audit", "--help"),
        ("audit", "--language", "zh", "--help"),
        ("archive", "report", "--language", "zh", "--help"),
    ):
        shown = _run(*arguments).stdout
        assert shown.startswith("用法：")
        assert "显示本说明并退出。" in shown
        assert not re.search(r"[a-z]{3,}\.$", shown, re.MULTILINE), shown


def test_a_usage_error_is_in_the_language_of_the_variable() -> None:
    """Also the part that click composes."""
    shown = _run("audit", "--foo", SCARASPEC_LANGUAGE="zh")
    assert shown.returncode == 2
    assert "错误：" in shown.stderr
    assert "--foo" in shown.stderr


def test_audit_in_chinese(tmp_path: Path, fixtures_dir: Path) -> None:
    """Summary, findings and page are Chinese; results.json is the same as in English."""
    capture = fixtures_dir / "captures/field/complaint-1.pcapng"
    files = {language: tmp_path / f"{language}.json" for language in ("en", "zh")}
    page = tmp_path / "report.html"
    shown = {
        language: _run(
            *("audit", f"{capture}", "--language", language),
            *("--json", f"{file}", "--html", f"{page}"),
        ).stdout
        for language, file in files.items()
    }
    assert "不符合" in shown["zh"]
    assert not _CHINESE.search(shown["en"])
    english, chinese = (file.read_bytes() for file in files.values())
    assert english == chinese
    finding = next(c for c in json.loads(english)["cases"] if c["verdict"] == "fail")
    template, values = finding["message_template"], finding["message_values"]
    message = UserMessage.of(finding["message"], template, values)
    translation = translate(message, Language.CHINESE)
    assert _CHINESE.search(translation)
    assert translation in shown["zh"]
    text = unescape(page.read_text("utf-8"))
    assert '<html lang="zh"' in text
    assert finding["message"] in text
    assert translation in text


def test_plan_in_chinese() -> None:
    """The plan of a certification has why cases are skipped."""
    shown = _run("--language", "zh", "certify", "controller", "--only", "4.1", "--dry-run").stdout
    assert re.match(r"将运行 \d+ 个用例中的 \d+ 个，用时约 \d+ s：", shown)
    assert "跳过：其危险等级未获许可：--allow state" in shown


def test_an_error_is_in_chinese(tmp_path: Path) -> None:
    """A problem of the user, with the values of its message."""
    shown = _run("audit", f"{tmp_path}", SCARASPEC_LANGUAGE="zh")
    assert shown.stderr == (
        f"scaraspec: {tmp_path} 中没有抓包：没有 .mcap、.pcap、.pcapng 或 .cap\n"
    )
    assert shown.returncode == 2


def test_commands_display_localized_text() -> None:
    """No command prints a sentence of an f-string, or a constant one, past the catalogues."""
    folder = ROOT / "conformance/scaraspec/cli"
    assert [
        f"{file.name}:{call.lineno}"
        for file in folder.rglob("*.py")
        for call in ast.walk(ast.parse(file.read_text("utf-8")))
        if isinstance(call, ast.Call) and getattr(call.func, "attr", "") in {"echo", "print"}
        if {word for each in call.args for word in _words(each)} - _UNTRANSLATED
    ] == []


_UNTRANSLATED = {"UTC", "bold", "html", "ok", "report", "scaraspec"}


def test_compared_values_are_messages() -> None:
    """What was expected and observed has no English words in an f-string or a concatenation."""
    folder = ROOT / "conformance/scaraspec"
    assert [
        f"{file.name}:{text.lineno}"
        for package in ("judge", "suite")
        for file in (folder / package).rglob("*.py")
        for value in _compared(ast.parse(file.read_text("utf-8")))
        for text in _composed(value)
        if _ENGLISH_WORD.search(_literal(text))
    ] == []


_ENGLISH_WORD = re.compile(r"\b[a-z]{3,}|\b(?:at|by|in|is|no|of|or|to)\b")
"""A word in lower case; units and patterns such as DDHHMMSS are the same in every language."""
_COMPARED = {"expected", "observed"}


def _compared(tree: ast.AST) -> Iterator[ast.expr]:
    """Yield the values of arguments, variables and attributes that are compared in a report."""
    for node in ast.walk(tree):
        match node:
            case ast.keyword(arg=str(name), value=value) if name in _COMPARED:
                yield value
            case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)):
                yield from (v for n, v in zip(names, values, strict=True) if _is_compared(n))
            case ast.Assign(targets=[target], value=value) if _is_compared(target):
                yield value


def _is_compared(target: ast.expr) -> bool:
    return getattr(target, "id", getattr(target, "attr", "")) in _COMPARED


def _composed(value: ast.expr) -> Iterator[ast.JoinedStr | ast.BinOp]:
    """Yield the f-strings and concatenations that an expression may have as its value."""
    match value:
        case ast.JoinedStr() | ast.BinOp(op=ast.Add()):
            yield value
        case ast.IfExp(body=body, orelse=other):
            yield from (*_composed(body), *_composed(other))
        case ast.BoolOp(values=values):
            for each in values:
                yield from _composed(each)


def _literal(text: ast.expr) -> str:
    """Return the literal parts of a composed text, without those that are passed to functions."""
    match text:
        case ast.Constant(value=str(part)):
            return part
        case ast.JoinedStr(values=parts):
            return " ".join(map(_literal, parts))
        case ast.BinOp(left=left, right=right):
            return f"{_literal(left)} {_literal(right)}"
    return ""


def _words(node: ast.expr) -> set[str]:
    """Return the words of a printed text that are not passed to a function."""
    literals = [part for part in ast.walk(node) if isinstance(part, ast.Constant)]
    passed = {
        id(part)
        for call in ast.walk(node)
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") not in {"Text", "visible"}
        for part in ast.walk(call)
    }
    return {
        word
        for literal in literals
        if isinstance(literal.value, str) and id(literal) not in passed
        for word in re.findall("[A-Za-z]{2,}", literal.value)
    }


def test_samples_are_current(messages: ModuleType) -> None:
    """docs/translation.md has samples of the present translations; else `make messages`."""
    assert messages.PAGE.read_text("utf-8") == messages.page()
