"""Implementation conformance statements: a proforma, and what is wrong with a statement."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from scaraspec.api.certify import StartError
from scaraspec.operating_system import state_directory
from scaraspec.report.model import Results, Role
from scaraspec.suite.controller.harness.access import UrlAccess
from scaraspec.suite.engine.ics import Ics, read_document
from scaraspec.suite.engine.ics_check import problems_of
from scaraspec.suite.engine.ics_proforma import Answers, proforma
from scaraspec.suite.engine.journal import Journal
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.selection import CLAIM
from scaraspec.transports.connect import resolve_url
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.suite.controller.harness.read_only_adapter import ReadOnlyAdapter


@dataclass(frozen=True, slots=True)
class CheckedIcs:
    """What is known about a statement.

    Attributes:
        problems: Mistakes, contradictions and wrong claims; a sentence each.
        verified: The keys of the claimed readings that the controller was seen to follow.
        unverified: The keys of the other claimed readings.
    """

    problems: tuple[str, ...]
    verified: tuple[str, ...] = ()
    unverified: tuple[str, ...] = ()


def new_ics(
    url: str = "",
    *,
    password: str = "password",  # noqa: S107 - the document's example (L109)
    state_dir: Path | None = None,
) -> str:
    """Return an ICS as TOML with every question.

    With a URL, it is filled in with what logins and queries show. Nothing on the controller is
    changed. Several connections are opened, so a controller that serves only one client may
    disconnect another one.

    Args:
        url: The link of the controller; empty to ask nothing.
        password: The password for the login over TCP.
        state_dir: Folder of the locks of runs; None for the user's state directory.

    Raises:
        LinkError: The URL is invalid.
        ControllerBusyError: A run uses the controller.
        JournalError: The state directory cannot be used.
        StartError: The controller could not be used.
    """
    if not url:
        return proforma()
    seen = _ask(url, password, Ics(), state_dir)
    version = seen.adapter.replies.get("get_version")
    readings = seen.results.readings[Role.CONTROLLER.value]
    return proforma(
        Answers(
            url,
            seen.results.run.begun_ns if seen.results.run else 0,
            version.frame.data.decode("utf-8", "replace") if version else "",
            {key: reading.options for key, reading in readings.items()},
            [name for name, reply in seen.adapter.replies.items() if reply is None],
        )
    )


def check_ics(
    path: Path,
    url: str = "",
    *,
    password: str = "password",  # noqa: S107 - the document's example (L109)
    state_dir: Path | None = None,
) -> CheckedIcs:
    """Find mistakes and contradictions in an ICS.

    With a URL, the claims that logins and queries show are verified, if there is no mistake. See
    `new_ics`.

    Args:
        path: The ICS.
        url: The link of the controller; empty to ask nothing.
        password: The password for the login over TCP.
        state_dir: Folder of the locks of runs; None for the user's state directory.

    Raises:
        UnreadableIcsError: The file cannot be read, or is not TOML.
        LinkError: The URL is invalid.
        ControllerBusyError: A run uses the controller.
        JournalError: The state directory cannot be used.
        StartError: The controller could not be used.
    """
    document = read_document(path)
    problems = problems_of(document)
    if problems or not url:
        return CheckedIcs(tuple(problems))
    ics = Ics.of(document)
    results = _ask(url, password, ics, state_dir).results
    wrong = [case for case in results.cases if case.id.startswith(CLAIM)]
    seen = results.readings[Role.CONTROLLER.value]
    verified = {key for key in ics.claimed if ics.dialect[key] in seen[key].options}
    contradicted = {case.id.removeprefix(CLAIM) for case in wrong}
    return CheckedIcs(
        tuple(
            UserMessage.joined(
                case.message,
                ": expected {expected}, observed {observed}",
                expected=case.expected,
                observed=case.observed,
            )
            for case in wrong
        ),
        tuple(sorted(verified - contradicted)),
        tuple(sorted(ics.claimed - verified - contradicted)),
    )


class _Seen(NamedTuple):
    adapter: "ReadOnlyAdapter"
    results: Results


def _ask(url: str, password: str, ics: Ics, state_dir: Path | None) -> _Seen:
    """Send only logins and queries, and return what they show."""
    from scaraspec.suite.controller.harness.read_only_adapter import (  # noqa: PLC0415 - hypothesis
        ReadOnlyAdapter,
    )
    from scaraspec.suite.engine.run import Run  # noqa: PLC0415 - imports pytest and hypothesis

    options = Options(only=frozenset())
    with Journal.of(resolve_url(url), state_dir or state_directory()) as journal:
        adapter = ReadOnlyAdapter(
            UrlAccess(url), ics, password.encode(), options, link=url, journal=journal
        )
        run = Run(adapter)
        results = run.results()
    if run.start_failure:
        raise StartError(run.start_failure)
    return _Seen(adapter, results)
