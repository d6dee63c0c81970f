"""report.html: one page for a person, in one file that asks nothing of the network.

Here results are put into the order in which they are read; how that looks is in the templates, the
words in `words`, the coordinates in `plots`. Everything that a template prints is escaped and made
visible by the environment, never by the template.
"""

import base64
import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from scaraspec.judge.requirements import REQUIREMENTS, Requirement
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.errors import TABLE_8_1
from scaraspec.protocol.readings import READINGS
from scaraspec.report import formatting as figures
from scaraspec.report.files import write_whole
from scaraspec.report.model import Case, CommandSeen, RequirementResult, Results, Session
from scaraspec.report.ordering import TELLING, UNSETTLED, most_telling_first, told_once
from scaraspec.report.plots import WIDTH, LatencyPlot, timeline
from scaraspec.report.sanitizing import visible
from scaraspec.report.segments import segments
from scaraspec.report.translations import CLAUSES, WORDS, Language, Words

_SIGNS: Final = {
    Verdict.FAIL: "✕",
    Verdict.ERROR: "!",
    Verdict.INCONCLUSIVE: "?",
    Verdict.TOLERATED: "≈",
    Verdict.PASS: "✓",
    Verdict.NONE: "·",
}
"""A verdict is never shown by its colour alone."""

_NS: Final = 1_000_000_000
_FIRST: Final = 5


def write(results: Results, path: Path, language: Language = Language.ENGLISH) -> None:
    """Write report.html, whole or not at all.

    Raises:
        OSError: It cannot be written.
    """
    write_whole(path, render(results, language))


def render(results: Results, language: Language = Language.ENGLISH) -> str:
    """The page; both languages are in it, and `language` is shown first."""
    cases = most_telling_first(results)
    session = results.session
    return (
        _environment()
        .get_template("report.html")
        .render(
            results=results,
            language=language.value,
            cases=cases,
            first=_first(cases),
            clauses=_clauses(results, cases),
            dialect=_keys(results),
            verdicts=[v for v in TELLING if results.counts.get(v)],
            session=session,
            latency=LatencyPlot(_by_opcode(session)) if session else None,
            lanes=timeline(results, session) if session else {},
        )
    )


def _first(cases: list[Case]) -> list[tuple[int, Case, int]]:
    """What to look at first: the number of a case on the page, and how many say the same."""
    numbered = {case.id: number for number, case in enumerate(cases)}
    told = told_once(case for case in cases if case.verdict in UNSETTLED)
    return [(numbered[case.id], case, others) for case, others in told[:_FIRST]]


def _by_opcode(session: Session) -> list[CommandSeen]:
    """The commands in the order of the document, undefined opcodes after them."""
    order = {name: at for at, name in enumerate(BY_NAME)}
    return sorted(session.exchanges, key=lambda command: order.get(command.name, len(order)))


def _keys(results: Results) -> list[str]:
    """The open points that show on either side, in the order of the document."""
    seen = {key for of_party in results.readings.values() for key in of_party}
    return [key for key in READINGS if key in seen] + sorted(seen - READINGS.keys())


@dataclass(frozen=True, slots=True)
class _Square:
    """One requirement in the matrix, and the number of its first case on the page."""

    result: RequirementResult
    requirement: Requirement | None
    case: int | None


def _clauses(results: Results, cases: list[Case]) -> dict[str, list[_Square]]:
    """The requirements in scope by clause, in the order of the document."""
    numbers = {case.id: number for number, case in reversed(list(enumerate(cases)))}
    clauses: dict[str, list[_Square]] = {}
    for result in results.requirements:
        first = min((numbers[c] for c in result.cases if c in numbers), default=None)
        square = _Square(result, REQUIREMENTS.get(result.id), first)
        clauses.setdefault(result.id.partition("/")[0], []).append(square)
    return clauses


@cache
def _both(words: Words) -> Markup:
    """A text in both languages, of which the page shows one."""
    return Markup(
        '<span class="en" lang="en">{}</span><span class="zh" lang="zh">{}</span>'
    ).format(*words)


def _say(key: str, **values: Any) -> Markup:
    """A text of the table in both languages, filled in."""
    text = _both(WORDS[key])
    return text.format(**{n: _finalize(v) for n, v in values.items()}) if values else text


def _attribute(name: str, key: str, language: str) -> Markup:
    """An attribute in the page's first language, with what the switch needs to change it."""
    words = WORDS[key]
    return Markup('{0}="{1}" data-attribute="{0}" data-en="{2.en}" data-zh="{2.zh}"').format(
        name, getattr(words, language), words
    )


def _finalize(value: Any) -> Any:
    """What becomes of each expression of a template before it is escaped."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("scaraspec.report"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_finalize,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    source = environment.loader.get_source  # type: ignore[union-attr]  # it was just given
    script, style = (source(environment, name)[0] for name in ("report.js", "report.css"))
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    environment.globals |= {
        "attribute": _attribute,
        "both": _both,
        "clause_words": CLAUSES,
        "codes": {text: Words(c.meaning, c.original) for text, c in TABLE_8_1.items()},
        "command_words": {n: Words(c.title, c.original) for n, c in BY_NAME.items()},
        "count": figures.count,
        "directions": tuple(Direction),
        "duration": figures.duration,
        "instant": figures.instant,
        "readings": READINGS,
        "requirements": REQUIREMENTS,
        "link_to": lambda file: quote(file, safe="/"),
        "say": _say,
        "script": Markup(script),  # noqa: S704 - our own file
        "script_digest": digest,
        "seconds": lambda time_ns: f"{time_ns // _NS}.{time_ns % _NS:09}",
        "segments": segments,
        "signs": {verdict.value: sign for verdict, sign in _SIGNS.items()},
        "style": Markup(style),  # noqa: S704 - our own file
        "width": WIDTH,
        "words": WORDS,
    }
    return environment
