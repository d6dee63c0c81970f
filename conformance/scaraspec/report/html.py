"""report.html: a page for users, in one file that makes no network requests.

This module prepares and orders the results. The layout is in the templates, the texts are in
`texts` and the coordinates in `plots`. Each text and message is on the page in both languages. The
environment escapes and sanitizes everything that a template prints; templates do not.
"""

import base64
import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import quote

from markupsafe import Markup, escape

from scaraspec.judge.requirements import REQUIREMENTS, Requirement
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.errors import TABLE_8_1
from scaraspec.protocol.readings import READINGS
from scaraspec.report import formatting, reproduction
from scaraspec.report.files import write_whole
from scaraspec.report.model import Case, CommandSeen, RequirementResult, Results, Session
from scaraspec.report.ordering import UNSETTLED, VERDICTS_BY_IMPORTANCE, most_important_first
from scaraspec.report.plots import WIDTH, LatencyPlot, timeline
from scaraspec.report.root_causes import SummaryLine, summary
from scaraspec.report.sanitizing import visible
from scaraspec.report.segments import segments
from scaraspec.report.texts import CLAUSE_TITLES, TEXTS
from scaraspec.translation import Language, display_language, translate

if TYPE_CHECKING:
    from jinja2 import Environment

_SIGNS: Final = {
    Verdict.FAIL: "✕",
    Verdict.ERROR: "!",
    Verdict.INCONCLUSIVE: "?",
    Verdict.TOLERATED: "≈",
    Verdict.PASS: "✓",
    Verdict.NONE: "·",
}
"""Signs of the verdicts: a verdict is not shown by its colour alone."""

_NS: Final = 1_000_000_000
_MOST_ROWS_OF_RUN: Final = 100  # of each table; the capture of the run has all
_MAX_TOP_LINES: Final = 5


def write(results: Results, path: Path, language: Language | None = None) -> None:
    """Write report.html atomically; the arguments are those of `render`.

    Raises:
        OSError: The file cannot be written.
    """
    write_whole(path, render(results, language))


def render(results: Results, language: Language | None = None) -> str:
    """Return the page. It contains both languages.

    Args:
        results: The results to show.
        language: The language that is shown first; None for the display language.
    """
    cases = most_important_first(results)
    session = results.session
    return (
        environment()
        .get_template("report.html")
        .render(
            results=results,
            language=language or display_language(),
            cases=cases,
            top_lines=_top_lines(results, cases),
            clauses=_clauses(results, cases),
            dialect=_open_points(results),
            verdicts=[v for v in VERDICTS_BY_IMPORTANCE if results.counts.get(v)],
            session=session,
            latency=LatencyPlot(_by_opcode(session)) if session else None,
            lanes=timeline(results, session) if session and not results.run else {},
            most_rows=_MOST_ROWS_OF_RUN if results.run else None,
        )
    )


def _top_lines(results: Results, cases: list[Case]) -> list[tuple[int, SummaryLine]]:
    """Return the most important lines of the summary, with the number of the case on the page."""
    numbered = {case.id: number for number, case in enumerate(cases)}
    lines = [line for line in summary(results) if line.case.verdict in UNSETTLED]
    return [(numbered[line.case.id], line) for line in lines[:_MAX_TOP_LINES]]


def _by_opcode(session: Session) -> list[CommandSeen]:
    """Return the commands in the order of the document, then undefined opcodes."""
    order = {name: at for at, name in enumerate(BY_NAME)}
    return sorted(session.exchanges, key=lambda command: order.get(command.name, len(order)))


def _open_points(results: Results) -> list[str]:
    """Return the keys of the open points of both sides, in the order of the document."""
    seen = {key for of_side in results.readings.values() for key in of_side}
    return [key for key in READINGS if key in seen] + sorted(seen - READINGS.keys())


@dataclass(frozen=True, slots=True)
class _Square:
    """A requirement in the coverage matrix, and the number of its first case on the page."""

    result: RequirementResult
    requirement: Requirement | None
    case: int | None


def _clauses(results: Results, cases: list[Case]) -> dict[str, list[_Square]]:
    """Return the requirements in scope by clause, in the order of the document."""
    numbers = {case.id: number for number, case in reversed(list(enumerate(cases)))}
    clauses: dict[str, list[_Square]] = {}
    for result in results.requirements:
        first = min((numbers[c] for c in result.cases if c in numbers), default=None)
        square = _Square(result, REQUIREMENTS.get(result.id), first)
        clauses.setdefault(result.id.partition("/")[0], []).append(square)
    return clauses


def _both(message: str) -> Markup:
    """Return a message in both languages, of which the page shows one; once without translation."""
    english, chinese = visible(message), visible(translate(message, Language.CHINESE))
    if english == chinese:
        return escape(english)
    return Markup(
        '<span class="en" lang="en">{}</span><span class="zh" lang="zh">{}</span>'
    ).format(english, chinese)


_both_of_text = cache(_both)


def _text(key: str, **values: Any) -> Markup:
    """Return a text of `TEXTS` in both languages with its values."""
    markup = _both_of_text(TEXTS[key])
    return markup.format(**{n: _finalize(v) for n, v in values.items()}) if values else markup


def _attribute(name: str, key: str, language: Language) -> Markup:
    """Return an attribute in the first language, with the data for the language switch."""
    text = TEXTS[key]
    return Markup('{0}="{1}" data-attribute="{0}" data-en="{2}" data-zh="{3}"').format(
        name, translate(text, language), text, translate(text, Language.CHINESE)
    )


def _finalize(value: Any) -> Any:
    """Sanitize the value of a template expression before it is escaped."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value


@cache
def environment() -> "Environment":
    """Return the environment of the templates of all pages, which sanitizes and escapes."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415 - slow

    created = Environment(
        loader=PackageLoader("scaraspec.report"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_finalize,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    source = created.loader.get_source  # type: ignore[union-attr]  # set above
    script, style = (source(created, name)[0] for name in ("report.js", "report.css"))
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    created.globals |= {
        "attribute": _attribute,
        "both": _both,
        "clause_titles": CLAUSE_TITLES,
        "codes": {text: code.meaning for text, code in TABLE_8_1.items()},
        "command_words": {name: command.title for name, command in BY_NAME.items()},
        "count": formatting.count,
        "directions": tuple(Direction),
        "duration": formatting.duration,
        "instant": formatting.instant,
        "readings": READINGS,
        "requirements": REQUIREMENTS,
        "link_to": lambda file: quote(file, safe="/"),
        "text": _text,
        "translate": translate,
        "repeating_script": reproduction.script_path,
        "script": Markup(script),  # noqa: S704 - our own file
        "script_digest": digest,
        "seconds": lambda time_ns: f"{time_ns // _NS}.{time_ns % _NS:09}",
        "segments": segments,
        "signs": {verdict.value: sign for verdict, sign in _SIGNS.items()},
        "steps": reproduction.steps,
        "style": Markup(style),  # noqa: S704 - our own file
        "width": WIDTH,
        "words": TEXTS,
    }
    return created
