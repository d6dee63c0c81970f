"""The certificate: one page to print about the result package of a certification.

A result other than conformant gives a test report on the same page. The layout is in the template.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from scaraspec.judge.requirements import REQUIREMENTS, Requirement
from scaraspec.judge.verdicts import Verdict
from scaraspec.register import DOCUMENT_SHA256
from scaraspec.report import formatting
from scaraspec.report.html import environment
from scaraspec.report.model import Case, Results, Tool
from scaraspec.report.ordering import VERDICTS_BY_IMPORTANCE
from scaraspec.translation import Language, display_language

_NOT_OPTIONS: Final = ("certification",)
"""The settings of a run that the page shows elsewhere."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """What the page states.

    Attributes:
        results: The results in the package.
        package: The name of the package.
        sha256: Its SHA-256 checksum.
        mandatory_id: The id of the list of mandatory cases.
        mandatory_sha256: The SHA-256 checksum of this list.
        sample: Serial number, firmware and hardware of the sample.
        laboratory: Name and operator of the laboratory.
        commit: The commit of the tool; empty if it is unknown.
        mutants: The number of mutants that the calibration has detected.
        signatory: Who has signed the package; empty if no signature was verified.
        has_signature: Whether there is a signature, verified or not.
        notes: Remarks of the verification.
    """

    results: Results
    package: str
    sha256: str
    mandatory_id: str
    mandatory_sha256: str
    sample: Mapping[str, str]
    laboratory: Mapping[str, str]
    commit: str
    mutants: int
    signatory: str
    has_signature: bool
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Violation:
    """A violated requirement, or a refuted claim, which has no id."""

    id: str
    requirement: Requirement | None
    cases: list[Case]


def render(certificate: Certificate, language: Language | None = None) -> str:
    """Return the page. It contains both languages.

    Args:
        certificate: What the page states.
        language: The language that is shown first; None for the display language.
    """
    results = certificate.results
    settings = results.run.settings if results.run else {}
    return (
        environment()
        .get_template("certificate.html")
        .render(
            certificate=certificate,
            results=results,
            language=language or display_language(),
            document_sha256=DOCUMENT_SHA256,
            options={k: v for k, v in settings.items() if v and k not in _NOT_OPTIONS},
            second=formatting.second,
            undecided=[each.id for each in results.requirements if not each.decided],
            verdicts=[v for v in VERDICTS_BY_IMPORTANCE if results.counts.get(v)],
            verifier=Tool.own(),
            violations=_violations(results),
        )
    )


def _violations(results: Results) -> list[_Violation]:
    """Return the violated requirements with their failed cases, in the order of the document."""
    failed: dict[str, list[Case]] = {}
    for case in results.cases:
        if case.verdict is Verdict.FAIL:
            for name in case.requirements or ("",):
                failed.setdefault(name, []).append(case)
    return [_Violation(name, REQUIREMENTS.get(name), cases) for name, cases in failed.items()]
