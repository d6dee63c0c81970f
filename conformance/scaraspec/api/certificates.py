"""Result packages of certifications: they are written at the end of a run, and verified later."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, BinaryIO, Final

from scaraspec.api.calibration import MUTANTS, Calibration, calibrate, chosen_mutants
from scaraspec.certificate import checks, package, signature
from scaraspec.certificate.environment import StatedEnvironment, environment, round_trip
from scaraspec.certificate.mandatory import MandatoryList, mandatory_lists
from scaraspec.certificate.package import Manifest, PackageError, obstacle
from scaraspec.judge.verdicts import ExitStatus, Verdict
from scaraspec.protocol.hazard import Hazard
from scaraspec.report import ctrf, html, junit
from scaraspec.report.certificate import Certificate, render
from scaraspec.report.codec import InvalidValueError, from_plain, to_plain
from scaraspec.report.files import write_new
from scaraspec.report.model import Results, ResultsError, Role, Tool
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.ics import LABORATORY, SAMPLE, Ics
from scaraspec.suite.engine.plan import Options
from scaraspec.translation import Language
from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError

if TYPE_CHECKING:
    from scaraspec.mutants.kill_matrix import Proof

__all__ = [
    "CalibrationError",
    "Certification",
    "CertificationError",
    "Check",
    "PackageError",
    "Verification",
    "calibrated",
    "certification",
    "verify_package",
    "write_certificate",
    "write_package",
]

_CALIBRATION: Final = "calibration.json"
_CONCLUSION: Final = "conclusion"
_ENVIRONMENT: Final = "environment.json"
_ICS: Final = "ics.json"
_NOT_RECORDED: Final = ("motion.", "hooks.")
"""The beginnings of the claims that a capture does not state."""


@dataclass(frozen=True, slots=True)
class Check:
    """One check of a package.

    Attributes:
        name: Its name.
        problems: One sentence for each thing that is wrong.
        note: What was checked, or why it was not.
        status: What follows from the check for the exit status.
    """

    name: str
    problems: tuple[str, ...] = ()
    note: str = ""
    status: ExitStatus = ExitStatus.CONFORMANT

    @property
    def passed(self) -> bool:
        """Whether nothing follows from it for the exit status."""
        return self.status is ExitStatus.CONFORMANT


@dataclass(frozen=True, slots=True)
class Verification:
    """What the checks of a package have found.

    Attributes:
        checks: The checks, in order. A check that needs what another one has refused is left out.
        signed: ``signed`` by the signer, ``unsigned``, or ``signature not checked``.
        results: The results in the package; None if they cannot be read.
        certificate: What a certificate or test report states; None if the package is refused, or
            if its results are inconclusive.
    """

    checks: tuple[Check, ...]
    signed: str
    results: Results | None
    certificate: Certificate | None = None

    @property
    def exit_status(self) -> ExitStatus:
        """The exit status: refused has priority over undecided."""
        found = {check.status for check in self.checks}
        for status in (ExitStatus.NONCONFORMANT, ExitStatus.INCONCLUSIVE):
            if status in found:
                return status
        return ExitStatus.CONFORMANT

    @property
    def genuine(self) -> bool:
        """Whether the package is verified, be its results conformant or not."""
        *others, last = self.checks
        return (
            last.name == _CONCLUSION
            and last.status is not ExitStatus.INCONCLUSIVE
            and all(each.passed for each in others)
        )


class CalibrationError(Exception):
    """The tester is not fit for a certification; one sentence for the user."""


class CertificationError(Exception):
    """A certification cannot begin; one sentence for the user."""


@dataclass(frozen=True, slots=True)
class Certification:
    """A certification that can begin.

    Attributes:
        package: The package to write.
        mandatory: The list of mandatory cases.
        options: The options of the run.
        calibration: The calibration of the tester; None before it.
    """

    package: Path
    mandatory: MandatoryList
    options: Options
    calibration: Calibration | None = None


def certification(  # noqa: PLR0913 - independent choices of a user
    role: Role,
    ics: Ics,
    package: Path,
    *,
    allowed: frozenset[Hazard] = frozenset(),
    seed: int = 0,
    undefined: bool = False,
) -> Certification:
    """Check what a certification needs, and return it with its options. Nothing is sent.

    Args:
        role: The role of the SUT.
        ics: The ICS with the sample and the laboratory.
        package: The package to write, ``NAME.scaraspec.zip``; it must not exist.
        allowed: The permitted hazards; for a controller all of them are needed.
        seed: The seed of all random values, 0 to 9.
        undefined: Send undefined opcodes, too; never to a robot that can move.

    Raises:
        CertificationError: Something is missing.
    """
    mandatory = mandatory_lists(role)[-1]
    options = checks.certification_options(role, mandatory, seed=seed, undefined=undefined)
    if lacking := sorted(hazard.value for hazard in options.allowed - allowed - {Hazard.READ_ONLY}):
        text = "a certification needs all hazards: --allow {hazards} is missing"
        raise CertificationError(UserMessage(text, hazards=",".join(lacking)))
    if seed not in checks.SEEDS:
        text = "the seed of a certification is 0 to 9, not {seed}"
        raise CertificationError(UserMessage(text, seed=seed))
    for table, keys, values in (
        ("sample", SAMPLE, ics.sample),
        ("laboratory", LABORATORY, ics.laboratory),
    ):
        if missing := [key for key in keys if not values.get(key)]:
            text = "a certification needs {key} in [{table}] of the ICS"
            raise CertificationError(UserMessage(text, key=missing[0], table=table))
    needed = {hook for case in collect(options, role) for hook in case.needs}
    if hooks := sorted(needed - ics.hooks.keys() - {*mandatory.optional_hooks}):
        text = "a certification needs the hook {hook} in [hooks] of the ICS"
        raise CertificationError(UserMessage(text, hook=hooks[0]))
    if problem := obstacle(package):
        raise CertificationError(problem)
    return Certification(package, mandatory, options)


def calibrated(
    certification: Certification,
    *,
    jobs: int = 1,
    mutant_ends: "Callable[[Proof], None]" = lambda _proof: None,
) -> Certification:
    """Calibrate the tester, unless that was done, and return the certification with the result.

    Args:
        certification: The certification.
        jobs: Number of processes.
        mutant_ends: Called with the result of each mutant.

    Raises:
        CalibrationError: The tester is not fit for a certification.
        KeyboardInterrupt: The user interrupted the calibration.
    """
    if certification.calibration:
        return certification
    role, seed = certification.mandatory.role, certification.options.seed
    calibration = calibrate(role, seed, jobs=jobs, mutant_ends=mutant_ends)
    if calibration.problem:
        text = "no certification on this machine: {problem}"
        raise CalibrationError(UserMessage(text, problem=calibration.problem))
    return replace(certification, calibration=calibration)


def write_package(certification: Certification, folder: Path, ics: Ics) -> None:
    """Write the package of a certification that has ended.

    Args:
        certification: The certification, calibrated. Its package must not exist.
        folder: The output folder of the run, with a recording in which passwords are masked.
        ics: The ICS of the run, with the sample and the laboratory.

    Raises:
        ResultsError: The results in the folder cannot be read.
        OSError: The package exists or cannot be written, or a file of the run is missing.
    """
    results, mandatory = Results.read(folder / package.RESULTS), certification.mandatory
    files = {name: folder / name for name in (package.RESULTS, package.CAPTURE)}
    with TemporaryDirectory(prefix="scaraspec-") as scratch:
        texts = {
            **_derived(results),
            _ICS: package.plain_json(_ics_of(ics)),
            _ENVIRONMENT: package.plain_json(environment(ics, results)),
            _CALIBRATION: package.plain_json(to_plain(certification.calibration)),
        }
        for name, text in texts.items():
            files[name] = _written(Path(scratch) / name, text)
        manifest = Manifest(
            results.tool,
            results.role,
            mandatory.id,
            mandatory.sha256,
            {name: package.file_of(file) for name, file in files.items()},
            package.case_sums(results),
        )
        files[package.MANIFEST] = _written(Path(scratch) / package.MANIFEST, manifest.to_json())
        package.write(certification.package, files)


def _written(path: Path, text: str) -> Path:
    path.write_bytes(text.encode("utf-8", "backslashreplace"))
    return path


def _ics_of(ics: Ics) -> dict[str, object]:
    """Return the ICS; of hooks only the names, because a command may contain a password."""
    return {
        "name": ics.name,
        "version": ics.version,
        "claims": ics.summary,
        "sample": ics.sample,
        "laboratory": ics.laboratory,
    }


def _derived(results: Results) -> dict[str, str]:
    """Return the files that follow from the results."""
    run = results.run
    return {
        "report.html": html.render(results),
        "junit.xml": junit.render(results),
        "ctrf.json": ctrf.render(results),
        "settings.json": package.plain_json({"seed": run.seed, **run.settings} if run else {}),
    }


def verify_package(
    path: Path,
    *,
    signer: Path | None = None,
    lists: Sequence[MandatoryList] | None = None,
) -> Verification:
    """Verify a package: files, signature, version, cases, options, verdict, capture and reports.

    Args:
        path: The package.
        signer: The public key of the signer, or a file of allowed signers. The signature is in the
            file with the name of the package and ``.sig``. None to check no signature.
        lists: The known lists of mandatory cases; None for those of this version.

    Raises:
        PackageError: The package cannot be read, or contains what no package may contain.
    """
    try:
        with path.open("rb") as file, TemporaryDirectory(prefix="scaraspec-") as scratch:
            folder = Path(scratch)
            names = package.extract(file, folder)
            manifest = package.read_manifest(folder)
            results = _results_in(folder)
            found = [_check_files(folder, names, manifest, results)]
            signed_check, signatory = _check_signature(path, file, signer)
            found.append(signed_check)
            if results and found[0].passed:
                known = mandatory_lists(manifest.role) if lists is None else lists
                found += _checks_of_results(folder, manifest, results, known)
            signed = (
                UserMessage("signed")
                if signer and signed_check.passed
                else signed_check.note or UserMessage("unsigned")
            )
            verification = Verification(tuple(found), signed, results)
            if results is None or not verification.genuine:
                return verification
            stated = _environment_in(folder)
            certificate = Certificate(
                results=results,
                package=path.name,
                sha256=package.sha256_of(file),
                mandatory_id=manifest.mandatory_id,
                mandatory_sha256=manifest.mandatory_sha256,
                sample=stated.sample,
                laboratory=stated.laboratory,
                commit=stated.tool.get("commit", ""),
                mutants=len(_calibration_in(folder).mutants),
                signatory=signatory,
                has_signature=signed != "unsigned",
                notes=tuple(p for each in found if each.passed for p in each.problems),
            )
            return replace(verification, certificate=certificate)
    except OSError as error:
        is_own = error.filename == f"{path}"
        text = (
            "it cannot be read: {reason}" if is_own else "its files cannot be extracted: {reason}"
        )
        status = ExitStatus.USAGE if is_own else ExitStatus.INCONCLUSIVE
        raise PackageError(UserMessage(text, reason=error.strerror), status) from None


def write_certificate(
    verification: Verification, path: Path, language: Language | None = None
) -> None:
    """Write the page of a verified package: a certificate, or a test report if not conformant.

    Args:
        verification: The verification of the package.
        path: The HTML page to write; it must not exist.
        language: The language that the page shows first; None for the display language.

    Raises:
        PackageError: The package is refused, or its results are inconclusive.
        OSError: The page exists or cannot be written.
    """
    if verification.certificate is None:
        text = "no certificate is written about a package that is refused or undecided"
        raise PackageError(text, verification.exit_status)
    write_new(path, render(verification.certificate, language))


def _results_in(folder: Path) -> Results | None:
    try:
        return Results.read(folder / package.RESULTS)
    except ResultsError:  # reported as a changed or missing file
        return None


def _check_files(
    folder: Path, names: frozenset[str], manifest: Manifest, results: Results | None
) -> Check:
    return _refusing(
        "files",
        package.file_problems(folder, names, manifest, results),
        UserMessage("{count} files as in the manifest", count=len(manifest.files)),
    )


def _check_signature(path: Path, file: BinaryIO, signer: Path | None) -> tuple[Check, str]:
    """Return the check, and who has signed; empty if no signature was verified."""
    signed = path.with_name(f"{path.name}{signature.SUFFIX}")
    if signer:
        found = signature.check(file, signed, signer)
        made_by = UserMessage("made by {signer}", signer=signer)
        return _refusing("signature", filter(None, [found.problem]), made_by), found.signatory
    note = "signature not checked" if signed.exists() else "unsigned"
    return Check("signature", note=note), ""


def _checks_of_results(
    folder: Path, manifest: Manifest, results: Results, lists: Sequence[MandatoryList]
) -> Iterator[Check]:
    mandatory = next((each for each in lists if each.id == manifest.mandatory_id), None)
    if mandatory is None:
        problem = UserMessage(
            "this version does not know the list {id} of scaraspec {version}: use that version",
            id=manifest.mandatory_id,
            version=manifest.tool.version,
        )
        yield Check("version", (problem,), status=ExitStatus.INCONCLUSIVE)
        return
    note = UserMessage("scaraspec {version}, {id}", version=mandatory.version, id=mandatory.id)
    version = _refusing("version", checks.version_problems(manifest, results, mandatory), note)
    yield version
    if not version.passed:
        return
    note = UserMessage("{count} mandatory cases", count=len(mandatory.cases))
    is_own = results.tool == Tool.own()
    needs = {case.id: case.needs for case in collect(Options(), results.role)} if is_own else None
    yield _refusing("cases", checks.case_problems(results, mandatory, needs), note)
    note = UserMessage("seed {seed}", seed=results.run.seed if results.run else "")
    yield _refusing("options", checks.option_problems(results, mandatory), note)
    yield _refusing("environment", _environment_problems(folder, results), "complete")
    problems = _calibration_problems(folder, results, is_own=is_own)
    yield _refusing("calibration", problems, "reference conformant, mutants killed")
    yield _check_capture(folder, results, is_own=is_own)
    if is_own:
        yield _refusing("reports", _report_problems(folder, results), "those of the results")
    yield _refusing(
        "verdicts", checks.verdict_problems(results, mandatory), "follow from the cases"
    )
    yield _conclusion(results)


def _environment_in(folder: Path) -> StatedEnvironment:
    return from_plain(StatedEnvironment, package.json_in(folder / _ENVIRONMENT))


def _environment_problems(folder: Path, results: Results) -> Iterator[str]:
    try:
        yield from _environment_in(folder).problems(package.json_in(folder / _ICS), results)
    except InvalidValueError as error:
        yield UserMessage("{name} is damaged: {error}", name=_ENVIRONMENT, error=error)


def _calibration_in(folder: Path) -> Calibration:
    return from_plain(Calibration, package.json_in(folder / _CALIBRATION))


def _calibration_problems(folder: Path, results: Results, *, is_own: bool) -> Iterator[str]:
    try:
        found = _calibration_in(folder)
    except InvalidValueError as error:
        yield UserMessage("{name} is damaged: {error}", name=_CALIBRATION, error=error)
        return
    if found.problem:
        yield found.problem
    if (found.role, found.seed) != (results.role, results.run.seed if results.run else None):
        yield "the calibration has another role or seed than the run"
    elif len(found.mutants) < MUTANTS or (
        is_own and {*found.mutants} != {*chosen_mutants(found.role, found.seed)}
    ):
        yield "the calibration has not tried the mutants that the seed chooses"


def _check_capture(folder: Path, results: Results, *, is_own: bool) -> Check:
    """Judge the capture again. A difference of another version is reported and not refused."""
    from scaraspec.api.auditing import audit  # noqa: PLC0415 - imports the readers of captures

    try:
        derived, notes = audit(folder / package.CAPTURE, subject=results.role)
    except (CaptureError, ValueError) as error:  # also an invalid reading or link
        return _refusing("capture", [f"{error}".replace(f"{folder}/", "")], "")
    problems = [*notes, *checks.capture_problems(results, derived)]
    stated = {k: v for k, v in results.subject.claims.items() if not k.startswith(_NOT_RECORDED)}
    if derived.subject.claims != stated:
        problems.append("the capture states other claims than the results")
    if is_own or not problems:
        return _refusing("capture", problems, "the judge finds the same again")
    note = UserMessage("differs, but scaraspec {version} judged it", version=results.tool.version)
    return Check("capture", tuple(problems), note)


def _report_problems(folder: Path, results: Results) -> Iterator[str]:
    for name, text in _derived(results).items():
        if not _has_text(folder / name, text):
            yield UserMessage("{name} is not that of the results", name=name)
    subject = results.subject
    stated = (subject.name, subject.version, subject.claims)
    ics = package.json_in(folder / _ICS)
    if stated != tuple(map(ics.get, ("name", "version", "claims"))):
        yield "ics.json has other claims than the results"
    if package.json_in(folder / _ENVIRONMENT).get("round_trip") != round_trip(results):
        yield "environment.json has another round trip than the results"


def _has_text(path: Path, text: str) -> bool:
    return path.is_file() and path.read_bytes() == text.encode("utf-8", "backslashreplace")


def _conclusion(results: Results) -> Check:
    """Return the check that the subject conforms."""
    status = results.verdict.exit_status
    if status is ExitStatus.CONFORMANT:
        return Check(_CONCLUSION, note=results.label)
    failed = [case.id for case in results.cases if case.verdict is Verdict.FAIL]
    problem: str = UserMessage(
        "the {role} is {label}", role=UserMessage(results.role.value), label=results.label
    )
    if failed:
        problem = UserMessage.joined(problem, ": {cases}", cases=", ".join(failed))
    undecided = status is not ExitStatus.NONCONFORMANT
    return Check(
        _CONCLUSION,
        (problem,),
        status=ExitStatus.INCONCLUSIVE if undecided else ExitStatus.NONCONFORMANT,
    )


def _refusing(name: str, problems: Iterable[str], note: str) -> Check:
    """Return a check that refuses the package if there are problems."""
    if listed := tuple(problems):
        return Check(name, listed, status=ExitStatus.NONCONFORMANT)
    return Check(name, note=note)
