"""Output of a comparison: plain lines, and Markdown."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.model import Case, Timing
from scaraspec.results.comparison import Change, Comparison
from scaraspec.results.dialogue_comparison import CaptureComparison
from scaraspec.results.markdown import escaped, table

_CONCLUSIONS: Final = {
    ExitStatus.CONFORMANT: "no difference",
    ExitStatus.NONCONFORMANT: "the behaviour differs",
    ExitStatus.INCONCLUSIVE: "no difference in what was recorded",
    ExitStatus.NOTHING_TESTED: "no traffic to compare",
}


def lines(comparison: Comparison) -> Iterator[str]:
    """Yield the comparison as plain lines."""
    yield from _titles(comparison)
    yield from _differences(comparison)
    yield "the behaviour differs" if comparison.differs else "no difference"
    for command, before, after in _latencies(comparison):
        yield f"latency · {command} · {before} -> {after}"


def markdown(comparison: Comparison) -> str:
    """Return the comparison as Markdown."""
    return _page(comparison, _differences(comparison), "no difference")


def _page(comparison: Comparison, differing: Iterable[str], conclusion: str) -> str:
    """Return a page with the differences, or without one with the conclusion."""
    differences = [f"- {escaped(line)}" for line in differing]
    parts = [
        "### scaraspec: comparison",
        "\n".join(f"- {escaped(title)}" for title in _titles(comparison)),
        "\n".join(differences) or f"{conclusion.capitalize()}.",
    ]
    if rows := list(_latencies(comparison)):
        parts.append(table(("command", "latency before", "latency after"), rows))
    return "\n\n".join(parts) + "\n"


def capture_lines(comparison: CaptureComparison) -> Iterator[str]:
    """Yield the comparison of two captures as plain lines."""
    yield from _titles(comparison.judged)
    yield from _capture_differences(comparison)
    yield _CONCLUSIONS[comparison.exit_status]
    for command, before, after in _latencies(comparison.judged):
        yield f"latency · {command} · {before} -> {after}"


def capture_markdown(comparison: CaptureComparison) -> str:
    """Return the comparison of two captures as Markdown."""
    conclusion = _CONCLUSIONS[comparison.exit_status]
    return _page(comparison.judged, _capture_differences(comparison), conclusion)


def _capture_differences(comparison: CaptureComparison) -> Iterator[str]:
    dialogue, judged = comparison.dialogue, comparison.judged
    yield from _changes("answered differently", dialogue.outcomes)
    yield from _changes("request", dialogue.actions)
    yield from _changes("replies", dialogue.replies)
    yield from _failures("new failure", judged.new)
    yield from _failures("gone failure", judged.gone)
    for before, after in judged.changed:
        yield f"changed failure · {after.id} · {before.message} -> {after.message}"
    yield from _changes("reading", judged.readings)


def _titles(comparison: Comparison) -> Iterator[str]:
    for word, results in (("before", comparison.before), ("after", comparison.after)):
        title = f"{results.subject.title} {results.subject.version}".rstrip()
        yield f"{word}: {title}: {results.label}"


def _differences(comparison: Comparison) -> Iterator[str]:
    yield from _failures("new failure", comparison.new)
    yield from _failures("gone failure", comparison.gone)
    for before, after in comparison.changed:
        yield f"changed failure · {after.id} · {before.message} -> {after.message}"
    yield from _changes("verdict", comparison.verdicts)
    yield from _changes("reading", comparison.readings)
    for word, ids in (("no longer judged", comparison.lost), ("now judged", comparison.gained)):
        if ids:
            yield f"{word} · {', '.join(ids)}"
    yield from _changes("setting", comparison.settings)


def _failures(word: str, cases: Sequence[Case]) -> Iterator[str]:
    return (f"{word} · {case.id} · {case.message}" for case in cases)


def _changes(word: str, changes: Sequence[Change]) -> Iterator[str]:
    for change in changes:
        yield f"{word} · {change.name} · {change.before or 'none'} -> {change.after or 'none'}"


def _latencies(comparison: Comparison) -> Iterator[tuple[str, str, str]]:
    for change in comparison.latency:
        yield change.command, _timing(change.before), _timing(change.after)


def _timing(timing: Timing | None) -> str:
    if timing is None:
        return "none"
    return f"p50 {timing.p50_ms:.3g} ms, p99 {timing.p99_ms:.3g} ms, {timing.count} times"
