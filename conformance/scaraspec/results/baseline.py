"""Baseline: what a gate accepts, made from the results of a run.

It contains the known failures, what was judged, and the settings. A baseline is a file under
version control: keys are sorted, so a change of it can be reviewed.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from scaraspec.report.codec import from_plain, to_plain
from scaraspec.report.files import write_whole
from scaraspec.report.model import SCHEMA as RESULTS_SCHEMA
from scaraspec.report.model import Case, Results, Role
from scaraspec.results.findings import decided, failures, place, stable_values
from scaraspec.user_message import UserMessage

SCHEMA: Final = "scaraspec.baseline/1"
_MAX_FILE_BYTES: Final = 64 * 2**20


class BaselineError(ValueError):
    """A baseline cannot be read; the message is one sentence for the user."""


@dataclass(frozen=True, slots=True)
class KnownFailure:
    """A failure that is accepted.

    Attributes:
        case: The id of the case; for a finding of the judge without its number.
        fingerprint: The fingerprint of the failure.
        message: Its message, for the reader.
        values: The values of the message that do not change if the run is repeated.
    """

    case: str
    fingerprint: str
    message: str
    values: Mapping[str, str]

    @classmethod
    def of(cls, case: Case) -> "KnownFailure":
        """Return a failed case as a known failure."""
        return cls(place(case), case.fingerprint, str(case.message), stable_values(case))


@dataclass(frozen=True, slots=True)
class Baseline:
    """What a gate accepts.

    Attributes:
        role: The role of the SUT.
        subject: The name of the SUT in its ICS.
        seed: The seed of the run.
        settings: The settings of the run and the claims of the SUT, by name.
        cases: The ids of the cases of the suite that were judged.
        requirements: The ids of the requirements that these cases have judged.
        failures: The known failures.
    """

    role: Role
    subject: str
    seed: int
    settings: Mapping[str, str]
    cases: tuple[str, ...]
    requirements: tuple[str, ...]
    failures: tuple[KnownFailure, ...]

    @classmethod
    def of(cls, results: Results) -> "Baseline":
        """Make a baseline of results.

        Raises:
            OldResultsError: The results have no fingerprints.
        """
        cases = {case.id for case in results.cases if decided(case)}
        return cls(
            role=results.role,
            subject=results.subject.name,
            seed=results.run.seed if results.run else 0,
            settings=settings_of(results),
            cases=tuple(sorted(cases)),
            requirements=tuple(
                sorted(
                    each.id
                    for each in results.requirements
                    if each.decided and not cases.isdisjoint(each.cases)
                )
            ),
            failures=tuple(
                sorted(
                    map(KnownFailure.of, failures(results)), key=lambda f: (f.case, f.fingerprint)
                )
            ),
        )

    def write(self, path: Path) -> None:
        """Write the baseline atomically. An earlier baseline is replaced.

        Raises:
            BaselineError: The file exists and is not a baseline.
            OSError: The file cannot be written.
        """
        if path.exists() and _schema_of(_plain_in(path)) != SCHEMA:
            raise BaselineError(
                UserMessage("{path} is not a baseline: name another file to write", path=path)
            )
        plain = {"schema": SCHEMA, **to_plain(self)}
        text = json.dumps(plain, ensure_ascii=False, indent=1, sort_keys=True)
        write_whole(path, f"{text}\n")

    @classmethod
    def read(cls, path: Path) -> "Baseline":
        """Read a baseline, or make one of a results.json.

        Raises:
            BaselineError: The file cannot be read or is not a baseline.
        """
        plain = _plain_in(path)
        try:
            return cls._of_plain(plain)
        except ValueError as error:  # also an invalid value
            raise BaselineError(UserMessage("{path}: {error}", path=path, error=error)) from None

    @classmethod
    def _of_plain(cls, plain: Any) -> "Baseline":
        schema = _schema_of(plain)
        if schema == SCHEMA:
            return from_plain(cls, plain)
        if schema == RESULTS_SCHEMA:
            return cls.of(from_plain(Results, plain))
        raise BaselineError(
            UserMessage(
                'its schema is not "{schema}": make a baseline with "scaraspec gate RESULTS '
                '--baseline FILE --update"',
                schema=SCHEMA,
            )
        )


def _plain_in(path: Path) -> Any:
    """Return the content of a JSON file.

    Raises:
        BaselineError: The file cannot be read or is not valid JSON.
    """
    try:
        with path.open("rb") as file:
            return json.loads(file.read(_MAX_FILE_BYTES))
    except OSError as error:
        raise BaselineError(
            UserMessage("{path} cannot be read: {reason}", path=path, reason=error.strerror)
        ) from None
    except (ValueError, RecursionError):
        raise BaselineError(
            UserMessage("{path} is not a baseline: it is not valid JSON", path=path)
        ) from None


def _schema_of(plain: Any) -> object:
    return plain.get("schema") if isinstance(plain, dict) else None


def settings_of(results: Results) -> dict[str, str]:
    """Return the settings and claims that decide what a run tests, without the seed."""
    return {**results.subject.claims, **(results.run.settings if results.run else {})}
