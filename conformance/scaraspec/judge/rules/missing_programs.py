"""Programs that are not stored: runs of them, code 20, and the default program."""

from typing import Final

from scaraspec.judge.rules.program_store import (
    deletions_of,
    is_complete_list,
    is_valid_program,
    listed_names,
)
from scaraspec.judge.rules.rule import (
    PASSED,
    RuleResult,
    failed,
    inconclusive,
    places_of,
    places_of_file,
    rule,
    tolerated,
)
from scaraspec.judge.rules.settings import MAX_UNSEEN_NS
from scaraspec.judge.rules.two_stage import TWO_STAGE
from scaraspec.protocol.fields import show
from scaraspec.traffic.events import Exchange
from scaraspec.traffic.exchange_history import answered_ns
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_RUNS: Final = ("run_program", "simulate_program")
_MISSING: Final = "20"
_SECOND_NS: Final = 1_000_000_000


def list_without(x: Exchange, robot: RobotState) -> Exchange | None:
    """Return the last list if it lacks the name in a request, and the name was not uploaded.

    A controller may ignore the extension of a name (A-0-9) or its case.
    """
    programs = robot.history.last("list_programs", before_ns=x.time_ns)
    if programs is None or x.time_ns - programs.time_ns > MAX_UNSEEN_NS:
        return None
    name = x.request.text
    uploaded = name in robot.history.uploaded_ns and name not in robot.history.deleted
    listed = {_stem(each) for each in listed_names(programs)}
    unlisted = not uploaded and is_complete_list(programs) and _stem(name) not in listed
    return programs if unlisted else None


def _stem(name: bytes) -> bytes:
    return name.lower().rpartition(b".")[0] or name.lower()


@rule("4.15/7", on=Exchange, names=("run_program",))
@rule("8/5", on=Exchange, names=("simulate_program",))
def unlisted_is_not_run(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A program that is not stored does not run (L314, L1044): every program is listed (L246)."""
    programs = list_without(x, robot)
    if programs is None or x.accepted is None:
        return None
    failure = x.reply_value if not x.accepted else x.outcome
    if failure and failure.code not in (_MISSING, None) and _was_idle(x, robot):
        return inconclusive(
            UserMessage(
                "{command} of {program}, which the last program list lacks, was refused or failed"
                " with {code} by an idle robot: either the code for a missing program is wrong,"
                " which is a violation, or a damaged file of this name is stored",
                command=x.name,
                program=show(x.request.text),
                code=failure.code,
            )
        )
    if not x.accepted or (x.outcome and not x.outcome.done):
        return PASSED
    if not x.outcome or next(deletions_of([x.request.text], x.time_ns, robot), None):
        return None  # 4.11/3 judges it
    return failed(
        UserMessage(
            "{command} succeeded for {program}, which the last program list lacks",
            command=x.name,
            program=show(x.request.text),
        ),
        expected="0|20",
        observed="11",
        at=(*places_of(programs), *places_of(x)),
    )


def _was_idle(x: Exchange, robot: RobotState) -> bool:
    """Whether the status was 00 shortly before, and no command and no transfer is active."""
    status = robot.history.last("get_status", before_ns=x.time_ns)
    if status is None or status.reply_value != "00" or x.concurrent or x.concurrent_uncertain:
        return False
    recent = x.time_ns - answered_ns(status) <= _SECOND_NS
    begun = robot.history.accepted and robot.history.accepted[-1]
    since = begun and begun is not x and begun.time_ns > status.time_ns
    interrupted = x.interrupted_by is not None or x.stop_requested
    return recent and not since and not robot.transferring and not interrupted


@rule("4.12/3", on=Exchange, names=("get_default_program",))
def default_is_a_program(x: Exchange, robot: RobotState) -> RuleResult | None:
    """The reply names a program (L272): it was listed, unless it was deleted since."""
    programs = robot.history.last("list_programs", before_ns=x.time_ns)
    name = x.reply_value
    if not isinstance(name, bytes) or not name.strip() or programs is None:
        return None
    deletion = robot.history.last_requests.get("delete_program")
    setting = robot.history.last_requests.get("set_default_program")
    unseen = x.time_ns - programs.time_ns > MAX_UNSEEN_NS or not is_complete_list(programs)
    if unseen or deletion or (setting and setting.text == name):
        return None
    if _stem(name) in {_stem(each) for each in listed_names(programs)}:
        return PASSED
    if robot.history.uploaded_ns.get(name, -1) > programs.time_ns:
        return None
    result = inconclusive(
        UserMessage(
            "{program} is the default program, but the last program list lacks it: either the reply"
            " is not the name of a program, which is a violation, or it was deleted before",
            program=show(name),
        )
    )
    return result._replace(places=(*places_of(programs), *places_of(x)))


@rule("8/5", on=Exchange, names=(*TWO_STAGE, "shutdown"))
def code_20(x: Exchange, robot: RobotState) -> RuleResult | None:
    """Code 20 means that the program file does not exist (L1044)."""
    failure = x.reply_value if x.accepted is False else x.outcome
    if failure is None or failure.code != _MISSING:
        return None
    if x.name not in _RUNS:
        return failed(
            UserMessage(
                "{command} names no program but was refused or failed with code 20", command=x.name
            ),
            expected="another code",
            observed="20",
        )
    name = x.request.text
    stored = robot.files.get(name)
    if stored and is_valid_program(stored):
        return failed(
            UserMessage(
                "{program} was refused or failed with code 20 although it was uploaded",
                program=show(name),
            ),
            expected="1, or another code",
            observed="20",
            at=(*places_of_file(stored), *places_of(x)),
        )
    if stored or _is_listed(name, x, robot):
        return tolerated(
            "A-4.15-2",
            "20",
            UserMessage(
                "code 20 was sent for {program}, which exists; the file may be damaged",
                program=show(name),
            ),
        )
    return PASSED


def _is_listed(name: bytes, x: Exchange, robot: RobotState) -> bool:
    """Return whether the last list contains it, and nothing was deleted since."""
    programs = robot.history.last("list_programs", before_ns=x.time_ns)
    deletion = robot.history.last_requests.get("delete_program")
    if programs is None or (deletion and deletion.place.time_ns >= programs.time_ns):
        return False
    return name in listed_names(programs)
