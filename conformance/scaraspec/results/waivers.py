"""Waivers: failures that someone has accepted until a date, read from TOML."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date, datetime
from pathlib import Path
from typing import Any, Final

from scaraspec.report.model import Case
from scaraspec.user_message import UserMessage

_TEXTS: Final = ("reason", "issue", "approver")
_KEYS: Final = ("case", "fingerprint", *_TEXTS, "expires", "flaky")


class WaiverError(ValueError):
    """A file of waivers is invalid; the message is one sentence for the user."""


@dataclass(frozen=True, slots=True)
class Waiver:
    """A failure that is accepted until a date.

    Attributes:
        case: The id of the case; empty if `fingerprint` names the failure.
        fingerprint: The fingerprint of the failure; empty if `case` names it.
        reason: Why the failure is accepted.
        issue: Where it is tracked.
        approver: Who has accepted it.
        expires: The last day on which the waiver is valid.
        flaky: The failure is intermittent: the case may pass.
    """

    case: str
    fingerprint: str
    reason: str
    issue: str
    approver: str
    expires: date
    flaky: bool = False

    @property
    def name(self) -> str:
        """What the waiver names: a case or a fingerprint."""
        return self.case or self.fingerprint

    @property
    def note(self) -> str:
        """The waiver in one line."""
        return UserMessage(
            "waived until {expires}: {reason} ({issue}, {approver})",
            expires=self.expires.isoformat(),
            reason=self.reason,
            issue=self.issue,
            approver=self.approver,
        )

    def covers(self, case: Case) -> bool:
        """Whether the waiver names this case or its failure."""
        return case.id == self.case or bool(
            self.fingerprint and case.fingerprint == self.fingerprint
        )


def read_waivers(path: Path) -> tuple[Waiver, ...]:
    """Read the waivers of a TOML file, each a table ``[[waiver]]``.

    Raises:
        WaiverError: The file cannot be read, or a waiver is incomplete or has an unknown key.
    """
    try:
        with path.open("rb") as file:
            document = tomllib.load(file)
    except OSError as error:
        raise WaiverError(
            UserMessage("{path} cannot be read: {strerror}", path=path, strerror=error.strerror)
        ) from None
    except (ValueError, RecursionError) as error:  # also no UTF-8, and too large a number
        raise WaiverError(
            UserMessage("{path} is not valid TOML: {error}", path=path, error=error)
        ) from None
    tables = document.get("waiver", [])
    if document.keys() - {"waiver"} or not isinstance(tables, list):
        raise WaiverError(UserMessage("{path} must contain only [[waiver]] tables", path=path))
    return tuple(_waiver(path, number, table) for number, table in enumerate(tables, 1))


def _waiver(path: Path, number: int, table: Mapping[str, Any]) -> Waiver:
    def invalid(problem: str) -> WaiverError:
        return WaiverError(
            UserMessage(
                "{path}: waiver {number} {problem}", path=path, number=number, problem=problem
            )
        )

    if not isinstance(table, dict):
        raise invalid("is not a table")
    if unknown := sorted(table.keys() - set(_KEYS)):
        raise invalid(
            UserMessage(
                "has an unknown key {key}: choose from {keys}",
                key=unknown[0],
                keys=", ".join(_KEYS),
            )
        )
    names = [name for name in ("case", "fingerprint") if name in table]
    if len(names) != 1:
        raise invalid("must have either case or fingerprint")
    for name in (*names, *_TEXTS):
        if not isinstance(table.get(name), str) or not table[name].strip():
            raise invalid(UserMessage('needs {name} = "text"', name=name))
    expires = table.get("expires")
    if not isinstance(expires, date) or isinstance(expires, datetime):
        raise invalid("needs expires = YYYY-MM-DD, a date without quotes")
    if not isinstance(table.get("flaky", False), bool):
        raise invalid("needs flaky = true or false")
    if table.get("flaky") and "case" not in table:
        raise invalid("must name its case: an intermittent failure has different fingerprints")
    return Waiver(**{"case": "", "fingerprint": "", **table})
