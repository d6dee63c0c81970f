"""The summary on a terminal: tables on a terminal, plain lines otherwise.

It shows the verdict of the run and the most important findings; the HTML page shows the rest. Text
from the SUT is sanitized: none of its control characters reaches the terminal.
"""

import re
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from rich.console import Console
from rich.table import Table
from rich.text import Text

from scaraspec.judge.verdicts import Conclusion
from scaraspec.report import formatting
from scaraspec.report.model import Case, Loss, Results, Role
from scaraspec.report.ordering import VERDICTS_BY_IMPORTANCE
from scaraspec.report.root_causes import SummaryLine, summary
from scaraspec.report.sanitizing import visible, visible_line

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
_ABBREVIATIONS: Final = (
    "A2C: from the client (application layer) to the controller; "
    "C2A: from the controller (control layer) to the client"
)
_MAX_REASONS: Final = 8
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
        console.print(_text(f"and {hidden} more findings in the report"), soft_wrap=True)
    for line in _losses(results):
        console.print(_text(line), soft_wrap=True)
    if results.role is Role.CAPTURE and shown:
        console.print(_text(_ABBREVIATIONS, "dim"), soft_wrap=True)
        if shown[0].case.moment and _SEVERAL_FILES not in results.subject.file:
            command = shlex.join(["scaraspec", "view", results.subject.file, "--finding", "1"])
            console.print(_text(f"to see the first finding: {command}", "dim"), soft_wrap=True)


def show_captures(captures: Iterable[tuple[str, Results | None, str]], console: Console) -> None:
    """Print the verdicts of several captures, the gravest first.

    Args:
        captures: For each capture its name, its results, and why it was not judged.
        console: The output.
    """
    rows = sorted((_capture_row(*each) for each in captures), key=lambda row: (row[0], row[2]))
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for heading in ("verdict", "capture", "cases", "finding"):
        table.add_column(heading, overflow="fold")
    for _, verdict, *texts in rows:
        if console.is_terminal:
            style = _STYLES.get(verdict.replace(" ", "-"), "bold magenta")
            table.add_row(_text(verdict, style), *map(_text, texts))
        else:
            line = " · ".join(filter(None, (verdict, *texts)))
            console.print(Text(visible_line(line)), soft_wrap=True)
    if console.is_terminal:
        console.print(table)
    counts = Counter(verdict for _, verdict, *_ in rows)
    total = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    console.print(_text(f"{len(rows)} captures: {total}"), soft_wrap=True)


def _capture_row(name: str, results: Results | None, error: str) -> tuple[int, str, str, str, str]:
    """Return the rank of a capture, its verdict, its name, its counts and its first finding."""
    if results is None:
        return _RANKS[Conclusion.INCONCLUSIVE], "not judged", name, "", error
    lines = summary(results)
    first = f"{_which(lines[0])}: {_what(lines[0].case)}" if lines else ""
    verdict = results.verdict
    return _RANKS[verdict], verdict.value.replace("-", " "), name, _counts(results), first


def _text(text: str, style: str = "") -> Text:
    """Return sanitized text without markup."""
    return Text(visible(text), style)


def _lines(results: Results, shown: Sequence[SummaryLine]) -> Iterator[str]:
    yield from results.notices
    yield f"{results.label}: {results.subject.title}"
    yield f"{_counts(results)}; {_coverage(results)}"
    yield from _not_judged(results)
    for side, dialect in _dialects(results):
        yield f"dialect of the {side}: {dialect}"
    for line in shown:
        case = line.case
        where = _where(case, results)
        parts = (case.verdict.value, _which(line), _what(case), _side(case), where, *_remarks(line))
        yield " · ".join(filter(None, parts))


def _draw(results: Results, shown: Sequence[SummaryLine], console: Console) -> None:
    for notice in results.notices:
        console.print(_text(notice, "bold yellow"))
    verdict = results.verdict.value
    console.print(
        _text(f"{results.label}  ", _STYLES[verdict]).append_text(_text(results.subject.title))
    )
    facts = Table.grid(padding=(0, 2))
    facts.add_column(style="dim")
    facts.add_column(overflow="fold")
    facts.add_row("cases", _counts(results))
    facts.add_row("coverage", _coverage(results))
    for line in _not_judged(results):
        facts.add_row("", _text(line))
    for side, dialect in _dialects(results):
        facts.add_row(_text(f"dialect, {side}"), _text(dialect))
    console.print(facts)
    if not shown:
        return
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for heading in ("verdict", "case", "finding", "where"):
        table.add_column(heading, overflow="fold")
    for each in shown:
        case, verdict = each.case, each.case.verdict.value
        what = "\n".join((" · ".join(filter(None, (_what(case), _side(case)))), *_remarks(each)))
        texts = map(_text, (_which(each), what, _where(case, results)))
        table.add_row(_text(verdict, _STYLES[verdict]), *texts)
    console.print()
    console.print(table)


def _counts(results: Results) -> str:
    counted = [
        f"{results.counts[v]} {v.value}" for v in VERDICTS_BY_IMPORTANCE if results.counts.get(v)
    ]
    tried = f"; {results.examples} examples" if results.examples else ""
    return (", ".join(counted) or "no cases") + tried


def _coverage(results: Results) -> str:
    return f"{results.judged} of {len(results.requirements)} requirements in scope judged"


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
            other = "the traffic does not decide it" if seen else "no traffic that shows it"
            reasons[tried[0].message if tried else other] += 1
    for reason, count in reasons.most_common(_MAX_REASONS):
        yield f"{count} not judged: {reason}"


def _dialects(results: Results) -> Iterator[tuple[str, str]]:
    """Yield for each side the observed readings that are not the default, with contradictions."""
    for side, seen in results.readings.items():
        observed = [
            f"{key}={'+'.join(reading.options)}{' (mixed)' if reading.mixed else ''}"
            for key, reading in seen.items()
            if reading.options and not reading.default
        ]
        if seen:
            yield side, ", ".join(observed) or "the default, as far as observed"


def _which(line: SummaryLine) -> str:
    return f"{line.name} and {line.others} more" if line.others else line.name


def _remarks(line: SummaryLine) -> Iterator[str]:
    """Yield what was not judged because of a failure, and its reproduction command."""
    if line.prevented:
        yield f"not judged because of it: {line.prevented}"
    if line.replay:
        yield line.replay


def _what(case: Case) -> str:
    """Return the finding in one line."""
    compared = [
        f"{name} {_one_line(text)}"
        for name, text in (("expected", case.expected), ("observed", case.observed))
        if text
    ]
    return f"{case.message} ({'; '.join(compared)})".strip() if compared else case.message


def _one_line(text: str, limit: int = 80) -> str:
    text = " ".join(text.split())
    return text if len(text) <= limit else f"{text[: limit - 1]}…"


def _side(case: Case) -> str:
    return case.side.value if case.side else ""


def _where(case: Case, results: Results) -> str:
    """Return the position; in a capture also the addresses, the packet and the time of day."""
    at = case.moment
    if at is None:
        return case.wire[0].place if case.wire else ""
    packet = f"packet {at.packet}" if at.packet else ""
    addresses = _addresses(results).get(at.connection, "")
    return ", ".join(filter(None, (at.place, addresses, packet, formatting.instant(at.time_ns))))


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
        yield f"and {hidden} more losses in the report"


def _loss(loss: Loss, addresses: str) -> str:
    size = "unknown length"
    if loss.length_bytes >= 0:
        size = f"{formatting.count(loss.length_bytes)} byte{'s' if loss.length_bytes != 1 else ''}"
    at = f"connection {loss.connection}, {loss.direction.value} byte {loss.offset_bytes}"
    return " · ".join(
        (
            "loss",
            size,
            ", ".join(filter(None, (at, addresses, formatting.instant(loss.time_ns)))),
            loss.note,
        )
    )
