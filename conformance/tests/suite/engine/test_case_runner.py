"""The verdict follows from what a case raises and from what the subject does during the case."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from scaraspec.judge.verdicts import Cause, Conclusion, Reason, Verdict
from scaraspec.mutants.controller import mutants
from scaraspec.mutants.controller_run import Robot, certified
from scaraspec.protocol.commands import BY_NAME, PasswordChange
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.failed_step import Stage
from scaraspec.report.model import Case, Results, Role
from scaraspec.suite.engine.collection import CASES, SuiteError
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, Request, Session

HEAD = """
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import CaseInconclusive, CaseSkipped, CaseFailed, expect

"""

Try = Callable[..., Results]


@pytest.fixture
def trial(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Try:
    """Run a suite of these cases on a controller."""

    def run(
        text: str,
        core: type[ControllerCore] = ControllerCore,
        options: Options = Options(allowed=ALL),  # noqa: B008 - it never changes
        ics: Ics = Ics(),  # noqa: B008 - it never changes
    ) -> Results:
        file = tmp_path / f"test_{abs(hash(tmp_path))}.py"  # modules are kept by their name
        file.write_text(HEAD + text, encoding="utf-8")
        monkeypatch.setitem(CASES, Role.CONTROLLER, tmp_path)
        return certified(Robot(core, DEFAULT), ics, options)

    return run


def only(results: Results, name: str = "4.8/2") -> Case:
    """The only case with this name."""
    (found,) = (case for case in results.cases if case.id == name)
    return found


@pytest.mark.parametrize(
    ("body", "verdict", "cause"),
    [
        ("line.ask('get_status')", Verdict.PASS, None),
        ("raise CaseFailed('wrong', expected='a', observed='b')", Verdict.FAIL, Cause.SUBJECT),
        ("raise CaseInconclusive('who knows')", Verdict.INCONCLUSIVE, Cause.SET_UP),
        ("raise CaseSkipped('no')", Verdict.NONE, Cause.SET_UP),
        ("1 / 0", Verdict.ERROR, Cause.SUITE),
        ("subject.hook('restart')", Verdict.NONE, Cause.SET_UP),
        ("line.reply('get_version')", Verdict.FAIL, Cause.SUBJECT),
        (
            "subject.tolerate('4.8/2', 'endian', 'big', 'so be it')",
            Verdict.TOLERATED,
            None,
        ),
    ],
)
def test_verdicts(trial: Try, body: str, verdict: Verdict, cause: Cause | None) -> None:
    """One verdict for each way in which a case can end."""
    results = trial(f"@case('4.8/2')\ndef test_one(subject, line):\n    {body}\n")
    case = only(results)
    assert (case.verdict, case.cause) == (verdict, cause)


def test_a_reply_behind_a_wrong_length(trial: Try) -> None:
    """A reply is found although the length of an earlier frame includes it."""
    results = trial(
        "@case('4.8/2')\ndef test_one(line):\n    line.ask('lock_joints')\n    line.wait(1)\n"
        "    line.ask('get_status')\n",
        mutants()["tag-behind-the-opcode"].wrong,
    )
    assert only(results).verdict is Verdict.PASS
    assert "3/7" in {each for case in results.cases for each in case.requirements}


class DiesOfAVersion(ControllerCore):
    """After a query of the version it answers nothing."""

    dead = False

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        type(self).dead |= frame.opcode == 0x08
        if not self.dead:
            super().handle(session, frame, now_s)


def test_a_subject_that_a_case_kills(trial: Try) -> None:
    """The case fails, and later cases are inconclusive, not failed."""
    DiesOfAVersion.dead = False
    results = trial(
        "@case('4.7/2')\ndef test_one(line):\n    line.send('get_version')\n\n"
        "@case('4.8/2')\ndef test_two(line):\n    line.ask('get_status')\n",
        DiesOfAVersion,
    )
    killer, after = only(results, "4.7/2"), only(results)
    assert (killer.verdict, killer.requirements) == (Verdict.FAIL, ("3/31",))
    assert (after.verdict, after.cause) == (Verdict.INCONCLUSIVE, Cause.DEPENDENCY)
    assert after.message.endswith("since the earlier case 4.7/2: login was not answered in 5 s")
    assert results.verdict is Conclusion.NONCONFORMANT


class DiesOfStrayBytes(ControllerCore):
    """Crashes when it receives bytes that are not a frame."""

    dead = False

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        type(self).dead |= data[:1] != b"\xaa"
        return [] if self.dead else super().receive(connection, data, now_s)


def test_stray_bytes_are_sent_last(trial: Try) -> None:
    """Cases that no client would cause come last, after all correct requests."""
    DiesOfStrayBytes.dead = False
    results = trial(
        "@case('3/19')\ndef test_one(line):\n    line.send_bytes(b'Hello')\n\n"
        "@case('4.8/2')\ndef test_two(line):\n    line.ask('get_status')\n",
        DiesOfStrayBytes,
    )
    assert only(results, "3/19").verdict is Verdict.FAIL
    assert only(results).verdict is Verdict.PASS


def test_order_of_cases_that_end_the_subject(trial: Try) -> None:
    """A case of clause 2 whose shutdown is refused runs before one whose shutdown is accepted."""
    body = "\ndef test_{}(line):\n    line.ask('get_status')\n\n"
    results = trial(
        "@case('2/11', last=True)"
        + body.format("one")
        + "@case('3/19')"
        + body.format("two")
        + "@case('4.35/2', last=True)"
        + body.format("three")
        + "@case('4.8/2')"
        + body.format("four")
    )
    assert [case.id for case in results.cases] == ["4.8/2", "3/19", "2/11", "4.35/2"]


class Reboots(ControllerCore):
    """After a query of the version it answers nothing for twelve seconds."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x08:
            self.back_s = now_s + 12
        if now_s >= self.back_s:
            super().handle(session, frame, now_s)

    back_s = 0.0


def test_a_restarted_subject_is_restored(trial: Try) -> None:
    """If a crashed subject restarts in time, the changes of earlier cases are restored."""
    results = trial(
        "from scaraspec.protocol.commands import Point\n\n"
        "@case('4.20/3')\ndef test_one(line):\n"
        "    line.ask('set_gripper_center', Point(1, 2, 3))\n    line.send('get_version')\n",
        Reboots,
    )
    assert only(results, "4.20/3").verdict is Verdict.FAIL
    assert {case.id for case in results.cases} == {"4.20/3"}


def test_a_run_continues_after_a_restart(trial: Try) -> None:
    """A device with a watchdog restarts without a hook."""
    results = trial(
        "@case('4.7/2')\ndef test_one(line):\n    line.send('get_version')\n\n"
        "@case('4.8/2')\ndef test_two(line):\n    line.ask('get_status')\n",
        Reboots,
    )
    assert only(results, "4.7/2").verdict is Verdict.FAIL
    assert only(results).verdict is Verdict.PASS


class RefusesLogins(ControllerCore):
    """After a query of the version it refuses every login."""

    logins = 0
    locked = False

    def get_version(self, request: Request) -> str:
        type(self).locked = True
        return super().get_version(request)

    def login(self, request: Request) -> bool:
        type(self).logins += self.locked
        return not self.locked and super().login(request)


def test_number_of_refused_logins_is_limited(trial: Try) -> None:
    """The controller is reachable, but may count wrong passwords."""
    RefusesLogins.logins, RefusesLogins.locked = 0, False
    text = "@case('4.7/2')\ndef test_one(line):\n    line.ask('get_version')\n"
    trial(text, RefusesLogins, Options())  # there is no password to restore
    assert 0 < RefusesLogins.logins < 10


def test_no_motion_with_an_unreadable_status(trial: Try) -> None:
    """It is unknown whether the arm is at rest; cases without motion still run."""
    results = trial(
        "@case('4.24/3')\ndef test_one(subject):\n    subject.moved = True\n\n"
        "@case('4.24/6')\ndef test_two(line):\n    1 / 0\n\n"
        "@case('4.7/2')\ndef test_three(line):\n    line.ask('get_version')\n",
        mutants()["state-in-words"].wrong,
    )
    for name in ("4.24/3", "4.24/6"):
        assert only(results, name).verdict is Verdict.INCONCLUSIVE
    assert only(results, "4.7/2").verdict is Verdict.PASS


class StaysAtFault(ControllerCore):
    """The arm stays out of range."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.plant.fail("05", 0.0, lasting=True)


def test_a_robot_in_an_error_state(trial: Try) -> None:
    """The robot answers, but in an error state; each case reports that state."""
    results = trial(
        "@case('4.24/3')\ndef test_one(subject):\n    subject.moved = True\n\n"
        "@case('4.8/2')\ndef test_two(line):\n    line.ask('get_status')\n",
        StaysAtFault,
    )
    for case in (only(results, "4.24/3"), only(results)):
        assert case.verdict is Verdict.INCONCLUSIVE
        assert "status stays 05" in case.message


def test_the_first_failure_of_each_requirement_is_enough(trial: Try) -> None:
    """A case that can fail another requirement still runs."""
    results = trial(
        "@case('4.8/2', name='a')\ndef test_one(line):\n    raise CaseFailed('wrong')\n\n"
        "@case('4.8/2', '4.8/3', name='b')\n"
        "def test_two(line):\n    raise CaseFailed('wrong', requirement='4.8/3')\n\n"
        "@case('4.8/3', '4.8/2', name='c')\ndef test_three(line):\n    1 / 0\n"
    )
    verdicts = [case.verdict for case in results.cases]
    assert verdicts == [Verdict.FAIL, Verdict.FAIL, Verdict.NONE]


def test_hazards_must_be_allowed(trial: Try) -> None:
    """Cases with other hazards are skipped, and a run without cases does not pass."""
    text = "@case('4.24/3')\ndef test_one(line):\n    1 / 0\n"
    results = trial(text, options=Options())
    assert only(results, "4.24/3").verdict is Verdict.NONE
    assert results.verdict is Conclusion.NOTHING_TESTED


def test_two_cases_with_one_name_are_an_error(trial: Try) -> None:
    """The second case would hide the first one."""
    one = "@case('4.8/2')\ndef test_{}(line):\n    line.ask('get_status')\n"
    with pytest.raises(SuiteError, match=r"4\.8/2"):
        trial(one.format("a") + one.format("b"))


def test_a_wrong_claim_is_a_separate_failure(trial: Try) -> None:
    """The claims of the ICS are compared with what is observed."""
    text = "@case('4.8/2')\ndef test_one(line):\n    line.ask('get_status')\n"
    claim = Ics().with_claims(prelogin="all")
    results = trial(text, ics=claim)
    assert only(results, "claim.prelogin").verdict is Verdict.FAIL


def test_changes_are_restored(trial: Try) -> None:
    """Password, clock and file that a case leaves changed are restored."""
    text = """
from datetime import datetime
from scaraspec.protocol.commands import PasswordChange, Point

@case('4.2/2')
def test_one(subject, line):
    line.ask('set_password', PasswordChange(subject.password, b'zs-Password'))
    line.ask('set_gripper_center', Point(1, 2, 3))
    line.ask('set_time', datetime(2001, 1, 1))

@case('4.8/2')
def test_two(subject, line):
    line.ask('get_status')
"""
    results = trial(text)
    seen = {command.name: command.count for command in results.session.exchanges}
    assert seen["set_password"] == 2
    assert seen["set_gripper_center"] == 2
    assert seen["set_time"] == 2
    assert "run.restore" not in {case.id for case in results.cases}


_LEAVES_A_CENTER = """
from scaraspec.protocol.commands import Point

@case('4.20/3')
def test_one(subject, line):
    line.ask('set_gripper_center', Point(1, 2, 3))
"""


@pytest.mark.parametrize(("signals", "left"), [(1, (0.0, 0.0, 0.0)), (2, (1.0, 2.0, 3.0))])
def test_signals_during_restoring(trial: Try, signals: int, left: tuple[float, ...]) -> None:
    """The first signal does not interrupt restoring, the second one ends it immediately."""
    stores = []

    class Signalled(ControllerCore):
        signals_left = signals

        def set_gripper_center(self, request: Request) -> bool:
            stores.append(self.store)
            if request.value == (0, 0, 0) and self.signals_left:
                self.signals_left -= 1
                raise KeyboardInterrupt
            return super().set_gripper_center(request)

    with pytest.raises(KeyboardInterrupt) if signals > 1 else nullcontext():
        assert {case.id for case in trial(_LEAVES_A_CENTER, Signalled).cases} == {"4.20/3"}
    assert stores[-1].settings.gripper_center == left


_ENDED_WHILE_IT_DRAWS = """
from hypothesis import given
from hypothesis import strategies as st

failed = []

@case('4.8/2', name='a')
@given(st.integers())
def test_one(subject, line, number):
    if failed:  # a simpler example is looked for
        END
    failed.append(number)
    raise CaseFailed('it is wrong', expected='', observed='')

@case('4.8/2', name='b')
def test_two(subject, line):
    line.ask('get_status')
"""
_ENDED_WHILE_GARBAGE_IS_COLLECTED = """
from contextlib import suppress

@case('4.8/2', name='a')
def test_one(subject, line):
    with suppress(KeyboardInterrupt):  # so does the interpreter
        subject.observer.interruption.ask()

@case('4.8/2', name='b')
def test_two(subject, line):
    line.ask('get_status')
"""


@pytest.mark.parametrize(
    "text",
    [
        _ENDED_WHILE_IT_DRAWS.replace("END", "subject.observer.interruption.ask()"),
        _ENDED_WHILE_IT_DRAWS.replace("END", "raise KeyboardInterrupt"),  # by pytest itself
        _ENDED_WHILE_GARBAGE_IS_COLLECTED,
    ],
)
def test_a_signal_ends_the_run(trial: Try, text: str) -> None:
    """Also if it comes after a failure of hypothesis, or its exception is lost."""
    assert "run.interrupted" in (found := {case.id for case in trial(text).cases})
    assert "4.8/2.b" not in found


class KeepsSmallLetters(ControllerCore):
    """Stores a new password in lower case, and compares a given password unchanged."""

    def set_password(self, request: Request) -> bool:
        old, new = request.value
        return super().set_password(replace(request, value=PasswordChange(old, new.lower())))


class KeepsFifteenBytes(ControllerCore):
    """Keeps only fifteen bytes of a new password, as in a buffer of sixteen with a NUL."""

    def set_password(self, request: Request) -> bool:
        old, new = request.value
        return super().set_password(replace(request, value=PasswordChange(old, new[:15])))


class ComparesWhatItKeeps(ControllerCore):
    """Keeps only eight bytes of a new password, and compares only eight in a login."""

    def set_password(self, request: Request) -> bool:
        old, new = request.value
        return super().set_password(replace(request, value=PasswordChange(old, new[:8])))

    def login(self, request: Request) -> bool:
        return super().login(replace(request, value=request.value[:8]))


@pytest.mark.parametrize("core", [KeepsSmallLetters, KeepsFifteenBytes, ComparesWhatItKeeps])
def test_the_password_is_restored(trial: Try, core: type[ControllerCore]) -> None:
    """The suite tries the variants of a password that a faulty subject may have stored, to restore
    it."""
    text = """
from scaraspec.protocol.commands import BY_NAME, PasswordChange

@case('4.2/2')
def test_one(subject, line):
    line.ask('set_password', PasswordChange(subject.password, b'zs-Password'))
"""
    results = trial(text, core)
    assert "run.restore" not in {case.id for case in results.cases}


def test_missing_hooks(trial: Try) -> None:
    """Cases without their hooks have a reason, and a notice names hooks and requirements."""
    results = trial(
        "@case('4.31/2', name='driven', needs=('set_input',))\ndef test_one(line):\n    pass\n\n"
        "@case('4.33/2', name='driven', needs=('set_analog',))\ndef test_two(line):\n    pass\n\n"
        "@case('4.33/2')\ndef test_three(line):\n    pass\n\n"
        "@case('4.8/2')\ndef test_four(subject):\n    subject.hook('restart')\n",
        options=Options(frozenset({"4.31/2", "4.33/2", "4.8/2"}), ALL),
    )
    reasons = {case.id: case.reason for case in results.cases if case.verdict is Verdict.NONE}
    assert reasons == dict.fromkeys(("4.31/2.driven", "4.33/2.driven", "4.8/2"), Reason.HOOK)
    (notice,) = results.notices
    assert notice == (
        "Not run: cases that need a hook which the ICS does not define (3: restart, set_analog, "
        "set_input). Define it in [hooks] of the ICS to judge 4.8/2, 4.31/2"
    )


def test_missing_hooks_of_judged_requirements(trial: Try) -> None:
    """The notice states that other cases have judged the requirements."""
    results = trial(
        "@case('4.31/2', name='driven', needs=('set_input',))\ndef test_one(line):\n    pass\n\n"
        "@case('4.31/2')\ndef test_two(line):\n    pass\n",
        options=Options(frozenset({"4.31/2"}), ALL),
    )
    assert results.verdict is Conclusion.CONFORMANT
    (notice,) = results.notices
    assert notice.endswith("(1: set_input). Other cases have judged their requirements")


class SilentAfterVersion(ControllerCore):
    """After a query of the version, its connection gets no replies."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._silent: set[int] = set()

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Serve the connections that have not asked for the version."""
        if frame.opcode == 0x08:
            self._silent.add(session.connection)
        if session.connection not in self._silent:
            super().handle(session, frame, now_s)


def test_undecided_findings_are_counted(trial: Try) -> None:
    """They change no verdict, and a requirement without other evidence is not judged."""
    results = trial(
        "@case('4.8/2')\ndef test_one(line):\n    line.send('get_version')\n    line.wait(6)\n",
        SilentAfterVersion,
        options=Options(frozenset({"4.8/2", "3/31"}), ALL),
    )
    assert only(results).verdict is Verdict.PASS
    assert results.undecided == {"3/31": 1}
    assert "the traffic does not decide (3/31: 1)" in results.notices[-1]
    judged = {each.id: each.verdict for each in results.requirements}
    assert judged == {"4.8/2": Verdict.PASS, "3/31": Verdict.NONE}
    assert results.verdict is Conclusion.NO_VIOLATION


class HasNoClock(ControllerCore):
    """Does not answer the query for the time."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Serve everything else."""
        if frame.opcode != BY_NAME["get_time"].opcode:
            super().handle(session, frame, now_s)


def test_a_dependency_fails_once(trial: Try) -> None:
    """The first case that needs the reply fails with that requirement; cases about the reply fail,
    too."""
    asks = "\ndef test_{}(line):\n    line.ask('get_time')\n\n"
    cases = ("4.5/4", "4.6/2", "4.7/2", "4.8/2")
    results = trial("".join(f"@case('{c}')" + asks.format(c[2]) for c in cases), HasNoClock)
    first, about, *prevented = (only(results, case) for case in cases)
    assert (first.verdict, first.requirements) == (Verdict.FAIL, ("3/31",))
    assert (about.verdict, about.requirements) == (Verdict.FAIL, ("3/31",))
    assert {case.reason for case in prevented} == {Reason.DEPENDENCY}
    assert prevented[0].message.startswith("3/31 failed already in case 4.5/4: get_time was not")
    assert {case.step.dependency for case in (first, *prevented) if case.step} == {"3/31"}
    assert about.step
    assert (about.step.command, about.step.missing, about.step.dependency) == ("get_time", True, "")
    (cause,) = results.causes
    assert cause.cases == ("4.5/4", "4.6/2")
    assert cause.prevented == ("4.7/2", "4.8/2")


def test_a_failure_shows_its_own_frames(trial: Try) -> None:
    """The frames with which a case restores its changes come later."""
    results = trial(
        "@case('4.8/2')\ndef test_one(line):\n"
        "    try:\n        expect(line.ask('get_version').accepted, 'wrong', observed='V1.0.0')\n"
        "    finally:\n        line.ask('get_time')\n"
    )
    case = only(results)
    assert case.wire[-1].note == "get_version, reply"
    assert case.step
    assert (case.step.command, case.step.stage) == ("get_version", Stage.REPLY)
    assert (case.step.time_ns, case.step.attempt) == (case.wire[-1].time_ns, 1)


def test_a_case_that_the_subject_does_not_survive_fails(trial: Try) -> None:
    """An earlier case had the same effect, but each may be a fault of its own."""
    crashes = "\ndef test_{}(line):\n    line.send('get_version')\n    line.ask('get_time')\n\n"
    cases = ("4.8/2", "4.9/6")
    results = trial("".join(f"@case('{c}')" + crashes.format(c[2]) for c in cases), Reboots)
    assert [only(results, case).verdict for case in cases] == [Verdict.FAIL] * 2
    assert [case.step.dependency for case in results.cases if case.step] == ["3/31"] * 2
