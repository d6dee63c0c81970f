"""`scaraspec verify`: versions, and results that were changed together with the manifest."""

import json
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from certification import (
    CASES,
    ICS,
    STATUS,
    Verify,
    calibrated,
    certification_of,
    certified,
    list_of_cases,
    packed,
    plain_in,
    rezipped,
)

from scaraspec.api import audit
from scaraspec.api.certificates import write_package
from scaraspec.certificate import checks
from scaraspec.certificate.mandatory import MandatoryList
from scaraspec.certificate.package import MANIFEST
from scaraspec.judge.verdicts import Cause, Conclusion, Reason, Verdict, conclude
from scaraspec.mutants.controller import mutants
from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame
from scaraspec.report import junit
from scaraspec.report.model import SEEN, Case, Results, Role, Session, Tool
from scaraspec.user_message import UserMessage
from scaraspec.virtual_controller.core import ControllerCore


def concluded(results: Results, *cases: Case) -> Results:
    """Return results with other cases, and all verdicts that follow from them."""
    by_id = {case.id: case.verdict for case in cases}
    requirements = tuple(
        replace(
            each,
            verdict=max(
                (by_id[i] for i in each.cases if i in by_id),
                key=list(Verdict).index,
                default=Verdict.NONE,
            ),
            cases=tuple(i for i in each.cases if i in by_id),
        )
        for each in results.requirements
    )
    counts = dict.fromkeys(Verdict, 0) | Counter(case.verdict for case in cases)
    verdict = conclude(counts, complete=all(each.decided for each in requirements))
    return replace(
        results, cases=cases, requirements=requirements, counts=counts, verdict=verdict, causes=()
    )


def with_settings(results: Results, seed: int = 0, **settings: str) -> Results:
    """Return results with other settings of the run."""
    assert results.run
    changed = {**results.run.settings, **settings}
    return replace(results, run=replace(results.run, seed=seed, settings=changed))


@pytest.fixture
def forge(run_folder: Path, small_list: MandatoryList, tmp_path: Path) -> Callable[[Results], Path]:
    """Make a package of changed results and the capture of the conformant certification."""
    capture = run_folder / "capture.mcap"
    return lambda results: packed(tmp_path / "forged", results, capture, small_list)


# Version.


def test_unknown_list(verify: Verify, package: Path) -> None:
    status, text = verify(package, lists=())
    assert status == 3
    unknown = f"controller-2026-01-01 of scaraspec {Tool.own().version}"
    assert f"this version does not know the list {unknown}" in text
    assert text.endswith(": it cannot be decided\n")


def test_altered_list(verify: Verify, package: Path, small_list: MandatoryList) -> None:
    status, text = verify(package, lists=(replace(small_list, optional_hooks=()),))
    assert status == 1
    assert "the list controller-2026-01-01 has another checksum" in text


@pytest.mark.parametrize("tool", [Tool("scaraspec", "0.1.9"), Tool("other", Tool.own().version)])
def test_another_tool(
    verify: Verify, results: Results, forge: Callable[[Results], Path], tool: Tool
) -> None:
    """The list names the version, so that no other one can be pretended."""
    status, text = verify(forge(replace(results, tool=tool)))
    assert status == 1
    assert f"is no list of {tool.name} {tool.version} for a controller" in text


def test_later_format(verify: Verify, package: Path, tmp_path: Path) -> None:
    text = json.dumps({**plain_in(package, MANIFEST), "schema": "scaraspec.package/9"})
    path = rezipped(package, tmp_path / "later.zip", manifest__json=text.encode())
    status, text = verify(path)
    assert (status, "use the version that made the package" in text) == (3, True)


def test_another_version(
    verify: Verify, results: Results, run_folder: Path, small_list: MandatoryList, tmp_path: Path
) -> None:
    """What another version judges differently is reported and not refused."""
    other = replace(small_list, version="0.1.9")
    seen = Case("4.8/1.seen-1", ("4.8/1",), Verdict.TOLERATED)
    changed = concluded(results, *results.cases, seen)
    changed = with_settings(changed, certification=other.title)
    changed = replace(changed, tool=Tool("scaraspec", "0.1.9"))
    path = packed(tmp_path / "other", changed, run_folder / "capture.mcap", other)
    status, text = verify(path, lists=(other,))
    assert status == 0, text
    assert "capture     ok  differs, but scaraspec 0.1.9 judged it" in text
    assert "the results have a finding on the wire about 4.8/1" in text


# Results that were changed together with the manifest.


@pytest.mark.parametrize("case_id", CASES)
@pytest.mark.parametrize("count", [0, 2])
def test_each_mandatory_case_once(
    verify: Verify, results: Results, forge: Callable[[Results], Path], case_id: str, count: int
) -> None:
    says = f"occurs {count} times" if count else "is missing"
    cases = [each for each in results.cases for _ in range(count if each.id == case_id else 1)]
    status, text = verify(forge(concluded(results, *cases)))
    assert status == 1
    assert f"case {case_id} {says}" in text


@pytest.mark.parametrize(
    ("reason", "message"),
    [
        (Reason.HAZARD, "it has a hazard that is not allowed"),
        (Reason.NOT_APPLICABLE, "the robot is not idle"),
        (Reason.SLOW, "it is slow"),
        (Reason.HOOK, UserMessage("it needs {hooks} in the ICS", hooks="motor_fault")),
    ],
)
def test_skipped_case(
    verify: Verify,
    results: Results,
    forge: Callable[[Results], Path],
    reason: Reason,
    message: str,
) -> None:
    skipped = [
        replace(case, verdict=Verdict.NONE, reason=reason, message=message, cause=Cause.SET_UP)
        if case.id == STATUS
        else case
        for case in results.cases
    ]
    status, text = verify(forge(concluded(results, *skipped)))
    assert status == 1
    assert f"case {STATUS} was skipped without a reason that the list allows: {message}" in text


def test_required_hook(
    verify: Verify,
    results: Results,
    run_folder: Path,
    small_list: MandatoryList,
    tmp_path: Path,
) -> None:
    """A case is skipped for want of a hook: the list decides whether it may be."""
    strict = replace(small_list, optional_hooks=("clear_faults",))
    changed = with_settings(results, certification=strict.title)
    path = packed(tmp_path / "forged", changed, run_folder / "capture.mcap", strict)
    status, text = verify(path, lists=(strict,))
    assert status == 1
    assert "case 4/3.fault was skipped" in text


class WithoutClockQuery(ControllerCore):
    """Does not know the opcode of get_time."""

    def _command(self, frame: Frame) -> Command | None:
        command = super()._command(frame)
        return None if command and command.name == "get_time" else command


def test_unsupported_command(verify: Verify, tmp_path: Path) -> None:
    """The cases of a command may be skipped if the ICS claims so, and if the run has tried it."""
    clock = "4.5/4"
    mandatory = list_of_cases((clock, STATUS))
    ics = replace(ICS, unsupported=frozenset({"get_time"}))
    results = certified(tmp_path, mandatory, WithoutClockQuery, ics)
    path = tmp_path / "package.zip"
    write_package(certification_of(path, mandatory), tmp_path, ics)
    status, text = verify(path, lists=(mandatory,))
    assert status == 0, text
    assert "no violation found (3 of 5 requirements judged), without get_time" in text
    assert results.session
    others = tuple(each for each in results.session.exchanges if each.name != "get_time")
    for changed in (
        replace(results, subject=replace(results.subject, claims={})),
        replace(results, session=replace(results.session, exchanges=others)),
    ):
        found = [*checks.case_problems(changed, mandatory)]
        assert [f"case {clock} was skipped" in problem for problem in found] == [True]


def test_a_refuted_claim(tmp_path: Path) -> None:
    """The capture shows that a command is answered which the ICS calls unsupported."""
    mandatory = list_of_cases((STATUS,))
    ics = replace(ICS, unsupported=frozenset({"get_time"}))
    results = certified(tmp_path, mandatory, ics=ics)
    derived, _ = audit(tmp_path / "capture.mcap")
    assert [*checks.capture_problems(results, derived)] == []
    others = [case for case in results.cases if case.id != "claim.lacks.get_time"]
    assert [*checks.capture_problems(concluded(results, *others), derived)] == [
        "the capture has a failure claim.lacks.get_time, but the results have not"
    ]


def test_another_reading(verify: Verify, tmp_path: Path) -> None:
    """The list names the claims under which no case can judge a requirement."""
    order, claim = "3/24", "readings.pipelining=one"
    mandatory = replace(list_of_cases((order, STATUS)), unless_claimed={order: (claim,)})
    ics = ICS.with_claims(pipelining="one")
    results = certified(tmp_path, mandatory, ics=ics)
    path = tmp_path / "package.zip"
    write_package(certification_of(path, mandatory), tmp_path, ics)
    status, text = verify(path, lists=(mandatory,))
    assert status == 0, text
    unclaimed = replace(results, subject=replace(results.subject, claims={}))
    for found in (
        checks.case_problems(unclaimed, mandatory),
        checks.case_problems(results, replace(mandatory, unless_claimed={})),
    ):
        assert [f"case {order} was skipped" in problem for problem in found] == [True]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("only", "4.8"), ("exhaustive", "false"), ("fail_fast", "true"), ("examples", "1")),
        *(("allow", "state"), ("certification", ""), ("patience_s", "0")),
    ],
)
def test_other_options(
    verify: Verify, results: Results, forge: Callable[[Results], Path], name: str, value: str
) -> None:
    status, text = verify(forge(with_settings(results, seed=0, **{name: value})))
    assert status == 1
    assert f'option {name} is "{value}"' in text


@pytest.mark.parametrize("name", ["reply_timeout_s", "time_scale", "undefined_opcodes"])
def test_missing_and_unknown_options(
    verify: Verify, results: Results, forge: Callable[[Results], Path], name: str
) -> None:
    """An option that the laboratory chooses is stated, and no other one exists."""
    assert results.run
    settings = {key: value for key, value in results.run.settings.items() if key != name}
    changed = replace(results, run=replace(results.run, settings={**settings, "skip\n": "4"}))
    status, text = verify(forge(changed))
    assert status == 1
    assert f"option {name} is missing" in text
    assert "option 'skip\\n' is not known" in text


def test_other_seed(verify: Verify, results: Results, forge: Callable[[Results], Path]) -> None:
    status, text = verify(forge(with_settings(results, seed=77)))
    assert (status, "the seed is not one of 0 to 9" in text) == (1, True)


def test_verdicts(verify: Verify, results: Results, forge: Callable[[Results], Path]) -> None:
    """Counts, requirements and conclusion must follow from the cases."""
    first = results.requirements[0]
    other = Verdict.TOLERATED if first.verdict is Verdict.PASS else Verdict.PASS
    changed = replace(
        results,
        verdict=Conclusion.CONFORMANT,
        counts={**results.counts, Verdict.PASS: 99},
        requirements=(replace(first, verdict=other, cases=()), *results.requirements[2:]),
    )
    status, text = verify(forge(changed))
    assert status == 1
    assert (
        f"requirement {first.id} is {other.value}, but its cases are {first.verdict.value}" in text
    )
    assert f"requirement {results.requirements[1].id} is missing" in text
    assert f"requirement {first.id} names other cases" in text
    assert "the numbers of verdicts are not those of the cases" in text
    assert "the verdict is conformant, but the cases are" in text


def test_other_reports(
    verify: Verify,
    run_folder: Path,
    small_list: MandatoryList,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A report that does not show the results is refused."""
    monkeypatch.setattr(junit, "render", lambda _: "<testsuite/>")
    path = tmp_path / "forged.zip"
    write_package(certification_of(path, small_list), run_folder, replace(ICS, version="9"))
    monkeypatch.undo()
    status, text = verify(path)
    assert status == 1
    assert "junit.xml is not that of the results" in text
    assert "ics.json has other claims than the results" in text


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"reference": Conclusion.NONCONFORMANT}, "the reference implementation is nonconformant"),
        ({"mutants": {**calibrated().mutants, "status-in-words": ()}}, "no case kills status-in-"),
        ({"mutants": {}}, "has not tried the mutants that the seed chooses"),
        ({"seed": 1}, "the calibration has another role or seed than the run"),
        ({"role": Role.CLIENT}, "the calibration has another role or seed than the run"),
    ],
)
def test_other_calibration(
    verify: Verify,
    run_folder: Path,
    tmp_path: Path,
    change: dict[str, Any],
    says: str,
) -> None:
    path = tmp_path / "forged.zip"
    right = certification_of(path, list_of_cases())
    write_package(replace(right, calibration=replace(calibrated(), **change)), run_folder, ICS)
    status, text = verify(path)
    assert (status, says in text) == (1, True), text


def test_no_calibration(verify: Verify, run_folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "forged.zip"
    write_package(
        replace(certification_of(path, list_of_cases()), calibration=None), run_folder, ICS
    )
    status, text = verify(path)
    assert (status, "calibration.json is damaged" in text) == (1, True), text


# A controller that violates the protocol.


@pytest.fixture(scope="session")
def faulty(tmp_path_factory: pytest.TempPathFactory, small_list: MandatoryList) -> Path:
    """Return the folder of a certification of a controller whose status has one digit."""
    folder = tmp_path_factory.mktemp("faulty")
    certified(folder, small_list, mutants()["status-of-one-digit"].wrong)
    return folder


def test_nonconformant(
    verify: Verify, faulty: Path, small_list: MandatoryList, tmp_path: Path
) -> None:
    """A genuine package of a nonconformant controller does not verify as conformant."""
    path = tmp_path / "faulty.scaraspec.zip"
    write_package(certification_of(path, small_list), faulty, ICS)
    status, text = verify(path)
    assert status == 1
    assert "conclusion  FAILED\n  the controller is nonconformant: " in text
    assert text.endswith("verified, unsigned: Cell 7 1.4: nonconformant\n")
    assert "REFUSED" not in text


def test_the_capture_contradicts(
    verify: Verify, faulty: Path, results: Results, small_list: MandatoryList, tmp_path: Path
) -> None:
    """Failures removed from the results, and a recomputed manifest: the capture has them."""
    found = Results.read(faulty / "results.json")
    good = [
        replace(case, verdict=Verdict.PASS, cause=None, message="", wire=(), reason=None)
        for case in found.cases
        if SEEN not in case.id
    ]
    path = packed(tmp_path / "forged", concluded(found, *good), faulty / "capture.mcap", small_list)
    status, text = verify(path)
    assert status == 1
    assert "the capture violates 4.8/2, but the results do not say so" in text
    path = packed(tmp_path / "other", results, faulty / "capture.mcap", small_list)
    status, text = verify(path)
    assert status == 1
    assert "the traffic in the results is not that of the capture" in text


def _other_traffic(results: Results) -> Iterator[Session]:
    """Yield the traffic of results, each time with another member that differs."""
    assert results.session
    session = results.session
    for name in ("begun_ns", "ended_ns", "frames", "undecodable_bytes"):
        yield replace(session, **{name: getattr(session, name) + 1})
    for name in ("connections", "exchanges"):
        assert getattr(session, name)
        yield replace(session, **{name: getattr(session, name)[1:]})


def test_each_change_of_the_traffic(results: Results, run_folder: Path) -> None:
    derived, _ = audit(run_folder / "capture.mcap")
    assert [*checks.capture_problems(results, derived)] == []
    for session in _other_traffic(results):
        found = [*checks.capture_problems(replace(results, session=session), derived)]
        assert found == ["the traffic in the results is not that of the capture"]


def test_the_time_of_the_run(results: Results, run_folder: Path) -> None:
    """The dates of a certificate are those of the run, which contains the capture."""
    derived, _ = audit(run_folder / "capture.mcap")
    assert results.run
    year_ns = 365 * 86400 * 10**9
    for years in (-1, 1):
        moved = replace(
            results.run,
            begun_ns=results.run.begun_ns + years * year_ns,
            ended_ns=results.run.ended_ns + years * year_ns,
        )
        found = [*checks.capture_problems(replace(results, run=moved), derived)]
        assert found == ["the capture is of another time than the run"]


def test_inconclusive(verify: Verify, results: Results, forge: Callable[[Results], Path]) -> None:
    """Without a violation and without a verdict it cannot be decided."""
    left = Case("run.restore", (), Verdict.INCONCLUSIVE, message="a file is left")
    status, text = verify(forge(concluded(results, *results.cases, left)))
    assert status == 3, text
    assert "the controller is inconclusive" in text


def test_the_cases_of_the_small_list(small_list: MandatoryList) -> None:
    assert set(small_list.cases) == set(CASES)
