"""Recovery: what an interrupted run has left on the controller is put back before anything else."""

from contextlib import suppress

from scaraspec.protocol.fields import show
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.guard import EVERYTHING
from scaraspec.suite.controller.harness.state.password import (
    PasswordLost,
    set_back,
    working_password,
)
from scaraspec.suite.controller.harness.state.restore import (
    DEFAULT_PROGRAM,
    ITEMS,
    restore,
    shown,
    snapshot,
    write_default,
)
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, NoReply
from scaraspec.suite.engine.journal import Changes
from scaraspec.user_message import UserMessage


class RecoveryError(Exception):
    """What an interrupted run has left cannot be put back; one sentence for the user."""


def recover(subject: ControllerUnderTest) -> None:
    """Put back what the journal says that an interrupted run has left.

    If motion may be under way the robot is stopped first.

    Raises:
        RecoveryError: The allowed hazards do not permit it, or it failed. The journal is kept.
        CaseFailed: The controller cannot be reached or does not answer.
        JournalError: The journal cannot be written.
    """
    earlier = subject.journal.earlier
    if earlier is None or not earlier.any:
        return
    if earlier.motion:
        _require(subject, {"the robot may still be moving": Hazard.MOTION})
    subject.journal.resume()
    try:
        told = _recovered(subject, earlier)
    except (PasswordLost, CaseInconclusive) as error:
        raise _failed(subject, f"{error}") from None
    subject.notify(
        UserMessage(
            "{subject}: {value}",
            subject=_interrupted(subject),
            value="; ".join(told) or "nothing was left",
        )
    )


def _recovered(subject: ControllerUnderTest, earlier: Changes) -> list[str]:
    """Do it; what was done, in a few words each."""
    told = []
    users = working = subject.password
    may_differ = bool(earlier.passwords) and subject.access.needs_login
    if may_differ:
        subject.password = working = working_password(subject)
    try:
        if earlier.motion:
            told.append(_stopped(subject))
        left = _left(subject, earlier, users)
        _require(subject, left)
        _put_default_back(subject, earlier)
    finally:
        subject.password = users
        subject.close_lines()
    if may_differ:
        try:
            set_back(subject, working)
        except CaseFailed as error:
            raise _failed(subject, f"the password: {error}") from None
    subject.moved = earlier.motion
    differences = restore(subject)
    if differences.ours:
        raise _failed(subject, "; ".join(differences.ours))
    return [*told, *(f"{what}, put back" for what in left), *differences.others]


def _put_default_back(subject: ControllerUnderTest, earlier: Changes) -> None:
    """Name the default program first: the suite's file in its place may resist deletion (A-4.11-1).

    If that fails, `restore` tries again and reports it.
    """
    default = earlier.settings.get(DEFAULT_PROGRAM)
    if default and DEFAULT_PROGRAM in earlier.changed and Hazard.STATE in subject.allowed:
        with suppress(CaseFailed, CaseInconclusive):
            write_default(subject, subject.open(), default)


def _stopped(subject: ControllerUnderTest) -> str:
    line = subject.open()
    answer = line.ask("emergency_stop")
    if not answer.accepted:
        return "nothing moved"
    try:
        line.result("emergency_stop", within_s=subject.reply_s)
    except NoReply:
        return "the emergency stop was accepted, and no final result came"
    return "the robot was stopped"


def _left(subject: ControllerUnderTest, earlier: Changes, users: bytes) -> dict[str, Hazard]:
    """What has to be put back, in a few words each, and the hazard that it needs."""
    left = {}
    if subject.password != users:
        ours = subject.password.decode("latin-1") in earlier.passwords
        named = show(subject.password) if ours else "an altered one"  # perhaps of the user's
        left[f"the password was {named}"] = Hazard.DESTRUCTIVE
    if earlier.files:
        left[f"{', '.join(earlier.files)} was stored"] = Hazard.STATE
    now = snapshot(subject, subject.open())
    for item in ITEMS:
        before = earlier.settings.get(item.name)
        changed = item.name in earlier.changed or EVERYTHING in earlier.changed
        if changed and before is not None and item.differs(subject, now.get(item.name), before):
            values = shown(item, now.get(item.name)), shown(item, before)
            left["the {} was {} in place of {}".format(item.name, *values)] = item.hazard
    return left


def _require(subject: ControllerUnderTest, left: dict[str, Hazard]) -> None:
    """Go on only if everything that is left may be put back.

    Raises:
        RecoveryError: It may not.
    """
    missing = {hazard.value for hazard in left.values() if hazard not in subject.allowed}
    if missing:
        allow = ",".join(sorted(missing | {h.value for h in subject.allowed} - {"read-only"}))
        raise RecoveryError(
            UserMessage(
                "{subject}, and {left}: allow the recovery with --allow {allow}",
                subject=_interrupted(subject),
                left="; ".join(left),
                allow=allow,
            )
        )


def _failed(subject: ControllerUnderTest, why: str) -> RecoveryError:
    return RecoveryError(
        UserMessage(
            "{subject}, and the controller could not be put back: {why}. Put it back by hand "
            "as the journal says, then delete the journal {path}",
            subject=_interrupted(subject),
            why=why,
            path=subject.journal.path,
        )
    )


def _interrupted(subject: ControllerUnderTest) -> str:
    earlier = subject.journal.earlier
    assert earlier is not None, "there is something to recover"
    return f"the run of {earlier.started} was interrupted"
