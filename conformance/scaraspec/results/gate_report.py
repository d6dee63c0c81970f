"""Output of a gate: lines, Markdown, annotations and code quality entries.

Text from the SUT is sanitized, and nothing in it is taken for markup or for a command of the CI
system.
"""

import json
from collections.abc import Iterator
from typing import Final

from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.model import Case
from scaraspec.report.sanitizing import visible
from scaraspec.results.gate import GateProblem, GateResult
from scaraspec.results.markdown import bullets, escaped, table
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage

CODE_QUALITY_MARK: Final = '"path": "scaraspec'
"""What a code quality report contains unless it is empty."""

_TITLES: Final = {
    ExitStatus.CONFORMANT: UserMessage("passed"),
    ExitStatus.NONCONFORMANT: UserMessage("failed"),
    ExitStatus.INCONCLUSIVE: UserMessage("inconclusive"),
    ExitStatus.NOTHING_TESTED: UserMessage("nothing was tested"),
}
_SHOWN_PROBLEMS: Final = 50
_ESCAPED: Final = {"%": "%25", "\n": "%0A"}
_ESCAPED_IN_VALUE: Final = {":": "%3A", ",": "%2C"}


def title_of(result: GateResult) -> str:
    """Return the result in one line."""
    count = len(result.problems)
    title = _TITLES[result.exit_status]
    if count:
        template = ": 1 problem" if count == 1 else ": {count} problems"
        title = UserMessage.joined(title, template, count=count)
    return UserMessage("gate {title}; {label}", title=title, label=result.results.label)


def lines(result: GateResult) -> Iterator[str]:
    """Yield the result as plain lines, problems first."""
    subject = result.results.subject.title
    yield UserMessage("{title}: {subject}", title=title_of(result), subject=subject)
    for problem in result.problems:
        yield _line(UserMessage(problem.kind.title), problem.id, problem.message)
        if problem.case and problem.case.replay:
            yield UserMessage("  reproduction command: {command}", command=problem.case.replay)
    for case in result.undecided:
        yield _line(UserMessage(case.verdict.value), case.id, case.message)
    if result.not_run:
        yield UserMessage(
            "inconclusive · --fail-fast · cases that did not run: {count}", count=result.not_run
        )
    for case_id, why in result.accepted.items():
        yield _line(UserMessage("accepted"), case_id, why)
    for failure in result.fixed:
        yield UserMessage(
            "fixed · {case} · the known failure does not occur any more; --update removes it",
            case=failure.case,
        )


def _line(what: str, name: str, message: str) -> str:
    return UserMessage("{what} · {name} · {message}", what=what, name=name, message=message)


def markdown(result: GateResult) -> str:
    """Return the result as Markdown in the display language, for the summary of a CI job."""
    rows = [(UserMessage(p.kind.title), p.id, p.message) for p in result.problems]
    rows += [(UserMessage(case.verdict.value), case.id, case.message) for case in result.undecided]
    title = localized(title_of(result))
    parts = [f"### scaraspec: {escaped(title)}", escaped(result.results.subject.title)]
    if rows:
        headings = (UserMessage("problem"), UserMessage("where"), UserMessage("message"))
        parts.append(table(headings, rows[:_SHOWN_PROBLEMS]))
    if len(rows) > _SHOWN_PROBLEMS:
        parts.append(localized("and {count} more", count=len(rows) - _SHOWN_PROBLEMS))
    accepted = (
        UserMessage("accepted: {case}: {why}", case=case_id, why=why)
        for case_id, why in result.accepted.items()
    )
    fixed = (UserMessage("fixed: {case}", case=failure.case) for failure in result.fixed)
    parts += [items for items in (bullets(accepted), bullets(fixed)) if items]
    return "\n\n".join(parts) + "\n"


def annotations(result: GateResult) -> Iterator[str]:
    """Yield the problems as workflow commands, which GitHub shows as annotations."""
    for problem in result.problems:
        title = _command_value(f"scaraspec: {problem.kind.title} {problem.id}")
        yield f"::error title={title}::{_command_text(problem.message)}"
    for case in result.undecided:
        title = _command_value(f"scaraspec: {case.verdict.value} {case.id}")
        yield f"::warning title={title}::{_command_text(case.message)}"


def code_quality(result: GateResult) -> str:
    """Return the problems as a code quality report of GitLab."""
    entries = [
        {
            "description": visible(f"{problem.kind.title}: {problem.id}: {problem.message}"),
            "check_name": problem.id,
            "fingerprint": _fingerprint(problem),
            "severity": "critical",
            "location": {"path": _path(problem.case), "lines": {"begin": 1}},
        }
        for problem in result.problems
    ]
    return json.dumps(entries, ensure_ascii=False, indent=1) + "\n"


def _fingerprint(problem: GateProblem) -> str:
    return problem.case.fingerprint if problem.case else f"{problem.kind.value}:{problem.id}"


def _path(case: Case | None) -> str:
    """Return the path of an entry: the format requires one, and there is no source file."""
    return f"scaraspec/{case.id}" if case else "scaraspec"


def _command_value(text: str) -> str:
    text = _command_text(text)
    for character, code in _ESCAPED_IN_VALUE.items():
        text = text.replace(character, code)
    return text


def _command_text(text: str) -> str:
    text = visible(text)
    for character, code in _ESCAPED.items():
        text = text.replace(character, code)
    return text
