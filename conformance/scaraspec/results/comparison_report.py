"""Output of a comparison: plain lines, and Markdown."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.model import Case, Timing
from scaraspec.results.comparison import Change, Comparison
from scaraspec.results.dialogue_comparison import CaptureComparison
from scaraspec.results.markdown import bullets, table
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage

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
        yield _difference(UserMessage("latency"), command, before, after)


def markdown(comparison: Comparison) -> str:
    """Return the comparison as Markdown in the display language."""
    return _page(comparison, _differences(comparison), "no difference")


def _page(comparison: Comparison, differing: Iterable[str], conclusion: str) -> str:
    """Return a page with the differences, or without one with the conclusion."""
    parts = [
        f"### {localized('scaraspec: comparison')}",
        bullets(_titles(comparison)),
        bullets(differing) or localized("{text}.", text=localized(conclusion).capitalize()),
    ]
    if rows := list(_latencies(comparison)):
        headings = ("latency before", "latency after")
        parts.append(table((UserMessage("command"), *headings), rows))
    return "\n\n".join(parts) + "\n"


def capture_lines(comparison: CaptureComparison) -> Iterator[str]:
    """Yield the comparison of two captures as plain lines."""
    yield from _titles(comparison.judged)
    yield from _capture_differences(comparison)
    yield _CONCLUSIONS[comparison.exit_status]
    for command, before, after in _latencies(comparison.judged):
        yield _difference(UserMessage("latency"), command, before, after)


def capture_markdown(comparison: CaptureComparison) -> str:
    """Return the comparison of two captures as Markdown in the display language."""
    conclusion = _CONCLUSIONS[comparison.exit_status]
    return _page(comparison.judged, _capture_differences(comparison), conclusion)


def _capture_differences(comparison: CaptureComparison) -> Iterator[str]:
    dialogue, judged = comparison.dialogue, comparison.judged
    yield from _changes(UserMessage("answered differently"), dialogue.outcomes)
    yield from _changes(UserMessage("request"), dialogue.actions)
    yield from _changes(UserMessage("replies"), dialogue.replies)
    yield from _failures("new failure", judged.new)
    yield from _failures("gone failure", judged.gone)
    for before, after in judged.changed:
        changed = UserMessage("changed failure")
        yield _difference(changed, after.id, before.message, after.message)
    yield from _changes(UserMessage("reading"), judged.readings)


def _titles(comparison: Comparison) -> Iterator[str]:
    for word, results in (
        (UserMessage("before"), comparison.before),
        (UserMessage("after"), comparison.after),
    ):
        title = f"{results.subject.title} {results.subject.version}".rstrip()
        yield UserMessage("{word}: {title}: {label}", word=word, title=title, label=results.label)


def _differences(comparison: Comparison) -> Iterator[str]:
    yield from _failures("new failure", comparison.new)
    yield from _failures("gone failure", comparison.gone)
    for before, after in comparison.changed:
        changed = UserMessage("changed failure")
        yield _difference(changed, after.id, before.message, after.message)
    yield from _changes(UserMessage("verdict"), comparison.verdicts)
    yield from _changes(UserMessage("reading"), comparison.readings)
    for word, ids in (("no longer judged", comparison.lost), ("now judged", comparison.gained)):
        if ids:
            yield UserMessage("{word} · {ids}", word=UserMessage(word), ids=", ".join(ids))
    yield from _changes(UserMessage("setting"), comparison.settings)


def _failures(word: str, cases: Sequence[Case]) -> Iterator[str]:
    return (
        UserMessage(
            "{what} · {name} · {message}",
            what=UserMessage(word),
            name=case.id,
            message=case.message,
        )
        for case in cases
    )


def _changes(word: str, changes: Sequence[Change]) -> Iterator[str]:
    for change in changes:
        before, after = (each or "–" for each in (change.before, change.after))
        yield _difference(word, change.name, before, after)


def _difference(what: str, name: str, before: str, after: str) -> str:
    return UserMessage(
        "{what} · {name} · {before} -> {after}", what=what, name=name, before=before, after=after
    )


def _latencies(comparison: Comparison) -> Iterator[tuple[str, str, str]]:
    for change in comparison.latency:
        yield change.command, _timing(change.before), _timing(change.after)


def _timing(timing: Timing | None) -> str:
    if timing is None:
        return "–"
    return UserMessage(
        "p50 {p50_ms} ms, p99 {p99_ms} ms, {count} times",
        p50_ms=f"{timing.p50_ms:.3g}",
        p99_ms=f"{timing.p99_ms:.3g}",
        count=timing.count,
    )
