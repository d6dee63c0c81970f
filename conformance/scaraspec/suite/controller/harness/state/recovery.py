"""Recovery: restores what an interrupted run has changed on the controller, before a new run."""

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
from scaraspec.user_message import UserMessage, sentence_of


class RecoveryError(Exception):
    """Changes of an interrupted run cannot be restored; the message is one sentence."""


def recover(subject: ControllerUnderTest) -> None:
    """Restore what an interrupted run has changed according to the journal.

    If the robot may still be moving, an emergency stop is sent first.

    Raises:
        RecoveryError: The allowed hazards do not permit the recovery, or it failed. The journal is
            kept.
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
        done = _recovered(subject, earlier)
    except (PasswordLost, CaseInconclusive) as error:
        raise _failed(subject, sentence_of(error)) from None
    subject.notify(
        UserMessage(
            "{interruption}: {done}",
            interruption=_interrupted(subject),
            done=UserMessage.listed(done, semicolons=True) or "nothing had to be restored",
        )
    )


def _recovered(subject: ControllerUnderTest, earlier: Changes) -> list[str]:
    """Restore the changes. Return a short description of each restored change."""
    done = []
    users = working = subject.password
    may_differ = bool(earlier.passwords) and subject.access.needs_login
    if may_differ:
        subject.password = working = working_password(subject)
    try:
        if earlier.motion:
            done.append(_stopped(subject))
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
            raise _failed(subject, UserMessage("the password: {error}", error=error)) from None
    subject.moved = earlier.motion
    differences = restore(subject)
    if differences.ours:
        raise _failed(subject, UserMessage.listed(differences.ours, semicolons=True))
    restored = [UserMessage("{change}, restored", change=what) for what in left]
    return [*done, *restored, *differences.others]


def _put_default_back(subject: ControllerUnderTest, earlier: Changes) -> None:
    """Restore the default program first.

    The controller may refuse to delete a file of the suite while it is the default program
    (A-4.11-1). If this fails, `restore` tries again and reports it.
    """
    default = earlier.settings.get(DEFAULT_PROGRAM)
    if default and DEFAULT_PROGRAM in earlier.changed and Hazard.STATE in subject.allowed:
        with suppress(CaseFailed, CaseInconclusive):
            write_default(subject, subject.open(), default)


def _stopped(subject: ControllerUnderTest) -> str:
    line = subject.open()
    answer = line.ask("emergency_stop")
    if not answer.accepted:
        return (
            "the controller refused the emergency stop: nothing was executing, or the stop failed"
        )
    try:
        line.result("emergency_stop", within_s=subject.reply_s)
    except NoReply:
        return "the emergency stop was accepted, but its final result did not come"
    return "the robot was stopped"


def _left(subject: ControllerUnderTest, earlier: Changes, users: bytes) -> dict[str, Hazard]:
    """Return descriptions of what must be restored, each with the hazard that it needs."""
    left: dict[str, Hazard] = {}
    if subject.password != users:
        ours = subject.password.decode("latin-1") in earlier.passwords
        # An altered one may contain the user's password.
        named = show(subject.password) if ours else UserMessage("an altered one")
        left[UserMessage("the password was {named}", named=named)] = Hazard.DESTRUCTIVE
    if earlier.files:
        left[UserMessage("{names} was still stored", names=", ".join(earlier.files))] = Hazard.STATE
    now = snapshot(subject, subject.open())
    for item in ITEMS:
        before = earlier.settings.get(item.name)
        changed = item.name in earlier.changed or EVERYTHING in earlier.changed
        if changed and before is not None and item.differs(subject, now.get(item.name), before):
            difference = UserMessage(
                "the {name} was {now} instead of {before}",
                name=UserMessage(item.name),
                now=shown(item, now.get(item.name)),
                before=shown(item, before),
            )
            left[difference] = item.hazard
    return left


def _require(subject: ControllerUnderTest, left: dict[str, Hazard]) -> None:
    """Continue only if the allowed hazards permit the whole recovery.

    Raises:
        RecoveryError: A hazard is not allowed.
    """
    missing = {hazard.value for hazard in left.values() if hazard not in subject.allowed}
    if missing:
        allow = ",".join(sorted(missing | {h.value for h in subject.allowed} - {"read-only"}))
        raise RecoveryError(
            UserMessage(
                "{interruption}, and {left}: allow the recovery with --allow {allow}",
                interruption=_interrupted(subject),
                left=UserMessage.listed(left, semicolons=True),
                allow=allow,
            )
        )


def _failed(subject: ControllerUnderTest, why: str) -> RecoveryError:
    return RecoveryError(
        UserMessage(
            "{interruption}, and the controller could not be restored: {why}. Restore the values "
            "in the journal {path} by hand, then delete this file",
            interruption=_interrupted(subject),
            why=why,
            path=subject.journal.path,
        )
    )


def _interrupted(subject: ControllerUnderTest) -> str:
    earlier = subject.journal.earlier
    assert earlier is not None, "a recovery needs an interrupted run"
    return UserMessage("the run of {started} was interrupted", started=earlier.started)
