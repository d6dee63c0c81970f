"""Recovery: what an interrupted run has left on the controller is put back before anything else."""

from scaraspec.protocol.fields import show
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.as_client.guard import EVERYTHING
from scaraspec.suite.as_client.state.password import PasswordLost, working_password
from scaraspec.suite.as_client.state.restore import ITEMS, restore, snapshot
from scaraspec.suite.as_client.subject import Subject
from scaraspec.suite.engine.journal import Changes
from scaraspec.suite.expect import NoAnswer, Undecided


class RecoveryError(Exception):
    """What an interrupted run has left cannot be put back; one sentence for the user."""


def recover(subject: Subject) -> None:
    """Put back what the journal says that an interrupted run has left.

    If motion may be under way the robot is stopped first.

    Raises:
        RecoveryError: The allowed hazards do not permit it, or it failed. The journal is kept.
        Unmet: The controller cannot be reached or does not answer.
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
    except (PasswordLost, Undecided) as error:
        raise _failed(subject, f"{error}") from None
    subject.notify(f"{_interrupted(subject)}: {', '.join(told) or 'nothing was left'}")


def _recovered(subject: Subject, earlier: Changes) -> list[str]:
    """Do it; what was done, in a few words each."""
    told = []
    users = subject.password
    if earlier.passwords and subject.access.needs_login:
        subject.password = working_password(subject)
    try:
        if earlier.motion:
            told.append(_stopped(subject))
        left = _left(subject, earlier, users)
    finally:
        subject.password = users
        subject.close_lines()
    _require(subject, left)
    subject.moved = earlier.motion
    if problems := restore(subject):
        raise _failed(subject, "; ".join(problems))
    return [*told, *(f"{what}, put back" for what in left)]


def _stopped(subject: Subject) -> str:
    line = subject.open()
    answer = line.ask("emergency_stop")
    if not answer.accepted:
        return "nothing moved"
    try:
        line.result("emergency_stop", within_s=subject.reply_s)
    except NoAnswer:
        return "the robot was told to stop, and did not say that it has stopped"
    return "the robot was stopped"


def _left(subject: Subject, earlier: Changes, users: bytes) -> dict[str, Hazard]:
    """What has to be put back, in a few words each, and the hazard that it needs."""
    left = {}
    if subject.password != users:
        left[f"the password was {show(subject.password)}"] = Hazard.DESTRUCTIVE
    if earlier.files:
        left[f"{', '.join(earlier.files)} was stored"] = Hazard.STATE
    now = snapshot(subject, subject.open())
    for item in ITEMS:
        before = earlier.settings.get(item.name)
        changed = item.name in earlier.changed or EVERYTHING in earlier.changed
        if changed and before is not None and item.differs(subject, now.get(item.name), before):
            left[f"the {item.name} was {now.get(item.name)} in place of {before}"] = item.hazard
    return left


def _require(subject: Subject, left: dict[str, Hazard]) -> None:
    """Go on only if everything that is left may be put back.

    Raises:
        RecoveryError: It may not.
    """
    missing = {hazard.value for hazard in left.values() if hazard not in subject.allowed}
    if missing:
        allow = ",".join(sorted(missing | {h.value for h in subject.allowed} - {"read-only"}))
        raise RecoveryError(
            f"{_interrupted(subject)}, and {'; '.join(left)}: allow the recovery with --allow "
            f"{allow}"
        )


def _failed(subject: Subject, why: str) -> RecoveryError:
    return RecoveryError(
        f"{_interrupted(subject)}, and the controller could not be put back: {why}. Put it back by "
        f"hand as the journal says, then delete the journal {subject.journal.path}"
    )


def _interrupted(subject: Subject) -> str:
    earlier = subject.journal.earlier
    assert earlier is not None, "there is something to recover"
    return f"the run of {earlier.started} was interrupted"
