"""The summary on a terminal: tables on a terminal, plain lines otherwise.

It shows the verdict of the run and the most important findings in the display language; the HTML
page shows the rest. Text from the SUT is sanitized: none of its control characters reaches the
terminal.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple

from rich.console import Console
from rich.table import Table
from rich.text import Text

from scaraspec.judge.verdicts import Conclusion, Verdict
from scaraspec.operating_system import join_command
from scaraspec.report import formatting
from scaraspec.report.model import Case, Loss, Results, Role
from scaraspec.report.ordering import VERDICTS_BY_IMPORTANCE
from scaraspec.report.root_causes import SummaryLine, summary
from scaraspec.report.sanitizing import visible, visible_line
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage

_STYLES: Final = {
    "conformant": "bold green",
    "no-violation-found": "bold cyan",
    "nonconformant": "bold red",
    "inconclusive": "bold magenta",
    "nothing-tested": "bold yellow",
    "pass": "green",
    "tolerated": "yellow",
    "fail": "red",
    "error": "bold red",
    "none": "dim",
}

_RANKS: Final = {
    Conclusion.NONCONFORMANT: 0,
    Conclusion.INCONCLUSIVE: 1,
    Conclusion.NOTHING_TESTED: 2,
    Conclusion.NO_VIOLATION: 3,
    Conclusion.CONFORMANT: 4,
}
"""The order of captures in a summary."""

DEFAULT_FINDINGS: Final = 10
_MAX_LOSSES: Final = 20
_ADDRESSES: Final = re.compile(r"[^\s(]+ (?:→|>) [^\s,)]+")
_ABBREVIATIONS: Final = UserMessage(
    "A2C: from the client (application layer) to the controller; "
    "C2A: from the controller (control layer) to the client"
)
_MAX_REASONS: Final = 8
_NOT_JUDGED: Final = UserMessage.of(Verdict.NONE.value, "not judged", {})
"""The verdict none, which another language has no short word for."""
_SEVERAL_FILES: Final = " … "
"""Between the first and the last file in the title of a recording in parts."""


def show(results: Results, console: Console, *, findings: int = DEFAULT_FINDINGS) -> None:
    """Print the summary.

    Args:
        results: The results to show.
        console: The output; tables are drawn only if it is a terminal.
        findings: The maximum number of findings, the most important first.
    """
    lines = summary(results)
    shown = lines[:findings]
    hidden = sum(1 + line.others + line.prevented for line in lines[findings:])
    if console.is_terminal:
        _draw(results, shown, console)
    else:
        for line in _lines(results, shown):
            console.print(Text(visible_line(line)), soft_wrap=True)
    if hidden:
        console.print(
            _text(localized("and {count} more findings in the report", count=hidden)),
            soft_wrap=True,
        )
    for line in _losses(results):
        console.print(_text(line), soft_wrap=True)
    if results.role is Role.CAPTURE and shown:
        console.print(_text(localized(_ABBREVIATIONS), "dim"), soft_wrap=True)
        if shown[0].case.moment and _SEVERAL_FILES not in results.subject.file:
            command = join_command(["scaraspec", "view", results.subject.file, "--finding", "1"])
            console.print(
                _text(localized("to see the first finding: {command}", command=command), "dim"),
                soft_wrap=True,
            )


def show_captures(captures: Iterable[tuple[str, Results | None, str]], console: Console) -> None:
    """Print the verdicts of several captures, the gravest first.

    Args:
        captures: For each capture its name, its results, and why it was not judged.
        console: The output.
    """
    rows = sorted((_capture_row(*each) for each in captures), key=lambda row: (row.rank, row.name))
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for heading in map(localized, ("verdict", "capture", "cases", "finding")):
        table.add_column(heading, overflow="fold")
    for row in rows:
        texts = (row.name, row.counts, row.finding)
        if console.is_terminal:
            style = _STYLES.get(row.verdict.replace(" ", "-"), "bold magenta")
            table.add_row(_text(localized(row.verdict), style), *map(_text, texts))
        else:
            line = " · ".join(filter(None, (localized(row.verdict), *texts)))
            console.print(Text(visible_line(line)), soft_wrap=True)
    if console.is_terminal:
        console.print(table)
    counts = Counter(row.verdict for row in rows)
    total = _list(f"{count} {localized(verdict)}" for verdict, count in counts.items())
    line = localized("{count} captures: {total}", count=len(rows), total=total)
    console.print(_text(line), soft_wrap=True)


class _CaptureRow(NamedTuple):
    """A line of the summary of several captures, and its rank."""

    rank: int
    verdict: str
    name: str
    counts: str
    finding: str


def _capture_row(name: str, results: Results | None, error: str) -> _CaptureRow:
    if results is None:
        rank = _RANKS[Conclusion.INCONCLUSIVE]
        return _CaptureRow(rank, "not judged", name, "", localized(error))
    lines = summary(results)
    first = ""
    if lines:
        violated, message = _which(lines[0]), _what(lines[0].case)
        first = localized("{violated}: {message}", violated=violated, message=message)
    verdict = results.verdict
    shown = verdict.value.replace("-", " ")
    return _CaptureRow(_RANKS[verdict], shown, name, _counts(results), first)


def verdict_name(verdict: Verdict) -> str:
    """Return a verdict in the display language."""
    return localized(_NOT_JUDGED if verdict is Verdict.NONE else verdict.value)


def _list(texts: Iterable[str]) -> str:
    """Return texts of the display language as a list, without empty ones."""
    return localized(UserMessage.listed(filter(None, texts)))


def _text(text: str, style: str = "") -> Text:
    """Return sanitized text without markup."""
    return Text(visible(text), style)


def _lines(results: Results, shown: Sequence[SummaryLine]) -> Iterator[str]:
    yield from map(localized, results.notices)
    yield localized("{label}: {title}", label=results.label, title=results.subject.title)
    yield localized("{counts}; {coverage}", counts=_counts(results), coverage=_coverage(results))
    yield from _not_judged(results)
    for side, dialect in _dialects(results):
        yield localized("dialect of the {side}: {dialect}", side=UserMessage(side), dialect=dialect)
    for line in shown:
        case = line.case
        where = _where(case, results)
        parts = (
            verdict_name(case.verdict),
            _which(line),
            _what(case),
            _side(case),
            where,
            *_remarks(line),
        )
        yield " · ".join(filter(None, parts))


def _draw(results: Results, shown: Sequence[SummaryLine], console: Console) -> None:
    for notice in results.notices:
        console.print(_text(localized(notice), "bold yellow"))
    verdict = results.verdict.value
    console.print(
        _text(f"{localized(results.label)}  ", _STYLES[verdict]).append_text(
            _text(results.subject.title)
        )
    )
    facts = Table.grid(padding=(0, 2))
    facts.add_column(style="dim")
    facts.add_column(overflow="fold")
    facts.add_row(localized("cases"), _counts(results))
    facts.add_row(localized("coverage"), _coverage(results))
    for line in _not_judged(results):
        facts.add_row("", _text(line))
    for side, dialect in _dialects(results):
        facts.add_row(_text(localized("dialect, {side}", side=UserMessage(side))), _text(dialect))
    console.print(facts)
    if not shown:
        return
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for heading in map(localized, ("verdict", "case", "finding", "where")):
        table.add_column(heading, overflow="fold")
    for each in shown:
        case, verdict = each.case, each.case.verdict.value
        what = "\n".join((" · ".join(filter(None, (_what(case), _side(case)))), *_remarks(each)))
        texts = map(_text, (_which(each), what, _where(case, results)))
        table.add_row(_text(verdict_name(case.verdict), _STYLES[verdict]), *texts)
    console.print()
    console.print(table)


def _counts(results: Results) -> str:
    counted = [
        f"{results.counts[v]} {verdict_name(v)}"
        for v in VERDICTS_BY_IMPORTANCE
        if results.counts.get(v)
    ]
    tried = localized("; {count} examples", count=results.examples) if results.examples else ""
    return (_list(counted) or localized("no cases")) + tried


def _coverage(results: Results) -> str:
    return localized(
        "{judged} of {total} requirements in scope judged",
        judged=results.judged,
        total=len(results.requirements),
    )


def _not_judged(results: Results) -> Iterator[str]:
    """Yield, for each reason, how many requirements were not judged."""
    if results.verdict is not Conclusion.NO_VIOLATION:
        return
    cases = {case.id: case for case in results.cases}
    reasons = Counter[str]()
    for requirement in results.requirements:
        if not requirement.decided:
            tried = [cases[each] for each in requirement.cases if each in cases]
            seen = requirement.id in results.undecided
            other = UserMessage(
                "the traffic does not decide it" if seen else "no traffic that shows it"
            )
            reasons[tried[0].message if tried else other] += 1
    for reason, count in reasons.most_common(_MAX_REASONS):
        yield localized("{count} not judged: {reason}", count=count, reason=localized(reason))


def _dialects(results: Results) -> Iterator[tuple[str, str]]:
    """Yield for each side the observed readings that are not the default, with contradictions."""
    for side, seen in results.readings.items():
        observed = [
            f"{key}={'+'.join(reading.options)}{localized(' (mixed)') if reading.mixed else ''}"
            for key, reading in seen.items()
            if reading.options and not reading.default
        ]
        if seen:
            yield side, ", ".join(observed) or localized("the default, as far as observed")


def _which(line: SummaryLine) -> str:
    if not line.others:
        return localized(line.name)
    return localized("{name} and {count} more", name=line.name, count=line.others)


def _remarks(line: SummaryLine) -> Iterator[str]:
    """Yield what was not judged because of a failure, and its reproduction command."""
    if line.prevented:
        yield localized("not judged because of it: {count}", count=line.prevented)
    if line.replay:
        yield line.replay


def _what(case: Case) -> str:
    """Return the finding in one line."""
    message = localized(case.message)
    compared = comparison(*(_one_line(localized(each)) for each in (case.expected, case.observed)))
    if not compared:
        return message
    return localized("{message} ({compared})", message=message, compared=compared).strip()


def comparison(expected: str, observed: str) -> str:
    """Return what was expected and observed in the display language, as far as it is stated."""
    if not expected:
        return localized("observed {observed}", observed=observed) if observed else ""
    if not observed:
        return localized("expected {expected}", expected=expected)
    template = "expected {expected}; observed {observed}"
    return localized(template, expected=expected, observed=observed)


def _one_line(text: str, limit: int = 80) -> str:
    text = " ".join(text.split())
    return text if len(text) <= limit else f"{text[: limit - 1]}…"


def _side(case: Case) -> str:
    return localized(case.side.value) if case.side else ""


def _where(case: Case, results: Results) -> str:
    """Return the position; in a capture also the addresses, the packet and the time of day."""
    at = case.moment
    if at is None:
        return localized(case.wire[0].place) if case.wire else ""
    packet = localized("packet {number}", number=at.packet) if at.packet else ""
    addresses = _addresses(results).get(at.connection, "")
    return _list((localized(at.place), addresses, packet, formatting.instant(at.time_ns)))


def _addresses(results: Results) -> dict[str, str]:
    """Return the addresses of each connection, client first, as far as they are known."""
    seen = results.session.connections if results.session else ()
    found = ((connection.name, _ADDRESSES.search(connection.note)) for connection in seen)
    return {name: match[0] for name, match in found if match}


def _losses(results: Results) -> Iterator[str]:
    """Yield a line for each loss of a capture: bytes, place, time and reason."""
    if results.role is not Role.CAPTURE or not results.session:
        return
    addresses = _addresses(results)
    losses = results.session.losses
    for loss in losses[:_MAX_LOSSES]:
        yield _loss(loss, addresses.get(loss.connection, ""))
    hidden = len(losses) + results.session.unlisted.get("losses", 0) - _MAX_LOSSES
    if hidden > 0:
        yield localized("and {count} more losses in the report", count=hidden)


def _loss(loss: Loss, addresses: str) -> str:
    size = localized("unknown length")
    if loss.length_bytes >= 0:
        template = "{count} byte" if loss.length_bytes == 1 else "{count} bytes"
        size = localized(template, count=formatting.count(loss.length_bytes))
    at = localized(
        "connection {connection}, {direction} byte {offset}",
        connection=loss.connection,
        direction=loss.direction.value,
        offset=loss.offset_bytes,
    )
    return " · ".join(
        (
            localized("loss"),
            size,
            _list((at, addresses, formatting.instant(loss.time_ns))),
            localized(loss.note),
        )
    )
