"""Clauses 4.10 and 4.11: stored programs, from uploads, deletions and lists."""

from collections import Counter
from collections.abc import Collection, Iterator
from functools import lru_cache
from itertools import pairwise, takewhile
from typing import Final

from scaraspec.judge.rules.rule import (
    PASSED,
    RuleResult,
    failed,
    places_of,
    places_of_file,
    rule,
    tolerated,
)
from scaraspec.judge.rules.settings import MAX_UNSEEN_NS
from scaraspec.protocol.fields import NAME_MAX_BYTES, Defect, show
from scaraspec.protocol.program_files import MAX_FILE_BYTES, Severity, lint
from scaraspec.protocol.program_files.layout import MAGIC
from scaraspec.traffic.events import Exchange, Transfer
from scaraspec.traffic.exchange_history import answered_ns
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_LIST: Final = ("list_programs",)
_RUNS: Final = ("run_program", "simulate_program")
_NAMING: Final = (*_RUNS, "set_default_program")
_LINE_ENDS: Final = (b"\r\n", b"\n", b"\r")
_OTHER_SEPARATORS: Final = (*_LINE_ENDS, b",", b";", b" ", b"\t", b"/", b"\0")
_PUSH_WAIT_NS: Final = 1_000_000_000
"""A client that requests again earlier may overlap with a pushed part (A-4.10-3)."""
_MAX_FETCH_NS: Final = 5_000_000_000
"""Maximum time from the request of a list in parts to its first part."""


def listed_names(x: Exchange) -> list[bytes]:
    """Return the names of all parts of a list."""
    return [name for part in x.parts if part.value for name in part.value.names]


def _starts_again(x: Exchange) -> bool:
    """Whether a requested next part is the first part again."""
    if not x.reply or not x.parts or x.parts[0] is x.reply:
        return False
    return x.parts[0].frame.data == x.reply.frame.data


def _repeats_its_beginning(x: Exchange) -> bool:
    """Whether a requested further part begins with the first name of the list again."""
    first, later = x.parts[0].value if x.parts else None, x.reply.value if x.reply else None
    if not first or not later or x.parts[0] is x.reply or x.parts[0].frame == x.parts[-1].frame:
        return False
    return bool(first.names and later.names) and first.names[0] == later.names[0]


def _pushed_part_missing(x: Exchange) -> bool:
    """Whether the client waited long enough for a pushed part before it requested again."""
    ahead = list(takewhile(lambda part: part is not x.reply, x.parts))
    again = all(part.frame.data == ahead[0].frame.data for part in ahead)
    since_ns = ahead[0 if again else -1].begun_ns
    return x.reply is not None and x.reply.begun_ns - since_ns >= _PUSH_WAIT_NS


def _is_unambiguous(x: Exchange, robot: RobotState) -> bool:
    """Return whether the parts belong to this list: concurrent lists may mix."""
    last = robot.history.last_requests.get(x.name, x.request)
    elsewhere = last.place.connection != x.request.place.connection
    later = x.reply is not None and x.reply.place.time_ns < last.place.time_ns
    return not x.same_opcode_pending and (last is x.request or elsewhere or later)


def _is_complete(x: Exchange, robot: RobotState) -> bool:
    return is_complete_list(x) and _is_unambiguous(x, robot)


def is_complete_list(x: Exchange) -> bool:
    """Return whether the last part of a list announces no other."""
    return bool(x.parts) and x.parts[-1].value is not None and not x.parts[-1].value.more


def list_begun_ns(x: Exchange) -> int:
    """Return a time that is not later than the request of the first part."""
    fetched = x.parts[0] is not x.reply
    return x.parts[0].begun_ns - _MAX_FETCH_NS if fetched else x.time_ns


# The list itself


@rule("4.10/4", on=Exchange, names=_LIST)
def last_part_has_flag_0(x: Exchange, robot: RobotState) -> RuleResult | None:
    """The last part of a list begins with "0" (L251); after "1" another part follows."""
    if _repeats_its_beginning(x) and _is_unambiguous(x, robot):
        return failed(
            "the list began again although its previous part announced another part",
            expected="0 in the last part",
            observed="1",
        )
    if _is_complete(x, robot):
        return PASSED
    if not (_starts_again(x) and _pushed_part_missing(x) and _is_unambiguous(x, robot)):
        return None
    return failed(
        "a list started again although the previous part announced another part",
        expected="0 in the last part",
        observed="1",
    )


@rule("4.10/5", on=Exchange, names=_LIST)
def next_part_comes(x: Exchange, _: RobotState) -> RuleResult | None:
    """After a part with "1" the next one comes, unsolicited or on request (L251; A-4.10-3)."""
    if len(x.parts) < 2 or _starts_again(x):  # noqa: PLR2004 - a part and the next
        return None
    if x.parts[-1] is not x.reply:
        return PASSED
    return tolerated(
        "list_cont", "request", "the next part of the list came only after another request"
    )


@rule("4.10/6", on=Exchange, names=_LIST)
def no_split_name(x: Exchange, robot: RobotState) -> RuleResult | None:
    """No name is split between two parts (L246); known names reveal it."""
    boundaries = [
        (a.value.names[-1], b.value.names[0])
        for a, b in pairwise(x.parts)
        if a.value and b.value and a.value.names and b.value.names
    ]
    for head, tail in boundaries:
        if _is_known(head + tail, robot) and _is_unambiguous(x, robot):
            return failed(
                "a name is split between two parts of the list",
                expected=show(head + tail),
                observed=UserMessage("{first} and {second}", first=show(head), second=show(tail)),
            )
    return PASSED if boundaries else None


def _has_extension(name: bytes) -> bool:
    """Whether a name ends like those of the document (A-0-9)."""
    return name.lower().endswith((b".rob", b".txt"))


def _is_known(name: bytes, robot: RobotState) -> bool:
    """Whether a program of this name was uploaded, run, or set as the default program."""
    accepted = (y for kind in _NAMING for y in robot.history.recent.get(kind, ()) if y.accepted)
    return name in robot.files or any(y.request_value == name for y in accepted)


@rule("4.10/7", on=Exchange, names=_LIST)
def names_are_unique(x: Exchange, robot: RobotState) -> RuleResult | None:
    """No name is empty or repeated in one list (L246)."""
    if (
        not x.parts
        or _starts_again(x)
        or _repeats_its_beginning(x)
        or not _is_unambiguous(x, robot)
    ):
        return None
    names = listed_names(x)
    for part in x.parts:
        for issue in part.parsed.decoded.issues if part.parsed else ():
            if issue.defect is Defect.EMPTY_NAME:
                return failed("a name in the list is empty", observed=show(part.frame.data))
    [(name, count)] = Counter(names).most_common(1) or [(b"", 0)]
    if count <= 1:
        return PASSED
    return failed(
        UserMessage("the list contains {program} {count} times", program=show(name), count=count),
        expected="once",
        observed=UserMessage("{count} times", count=count),
    )


@rule("4.10/3", on=Exchange, names=_LIST)
def names_are_apart(x: Exchange, robot: RobotState) -> RuleResult | None:
    """No other character separates the names (L246): known names and extensions reveal it."""
    for name in listed_names(x):
        if _is_known(name, robot):
            continue
        for separator in _OTHER_SEPARATORS:
            apart = [each for each in name.split(separator) if each]
            known = all(_is_known(each, robot) or _has_extension(each) for each in apart)
            if len(apart) > 1 and (known or separator in _LINE_ENDS):
                return failed(
                    "the names in the list are not separated by '|'",
                    expected=show(b"|".join(apart)),
                    observed=show(name),
                )
    return None


# Programs that must be in the list, and that must not


def is_valid_program(transfer: Transfer) -> bool:
    """Return whether a file is a program by clause 6, without a lint warning."""
    plausible = transfer.content.startswith(MAGIC) and len(transfer.content) <= MAX_FILE_BYTES
    return plausible and transfer.whole_content and _has_no_finding(transfer)


@lru_cache(maxsize=16)
def _has_no_finding(transfer: Transfer) -> bool:
    return all(f.severity is Severity.INFO for f in lint(bytes(transfer.content)))


@rule("4.10/11", on=Exchange, names=_LIST)
def uploaded_is_listed(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A valid program is listed after its upload (L246); other files need not be.

    Names that are too long or contain a bar are open points (A-5-20, A-T-6).
    """
    if not _is_complete(x, robot):
        return None
    listed = set(listed_names(x))
    before_ns = list_begun_ns(x)
    expected = [
        t
        for t in robot.files.values()
        if t.ended_ns < before_ns and len(t.name) <= NAME_MAX_BYTES and b"|" not in t.name
    ]
    missing = [t for t in expected if t.name not in listed]
    for transfer in missing:
        if is_valid_program(transfer):
            return failed(
                _missing_message(transfer.name, listed, robot),
                expected="in the list",
                observed=UserMessage("{count} other names", count=len(listed)),
                at=(*places_of_file(transfer), *places_of(x)),
            )
    return PASSED if len(missing) < len(expected) else None


def _missing_message(name: bytes, listed: Collection[bytes], robot: RobotState) -> UserMessage:
    """Say that an uploaded program is missing, and which similar name may be the cause."""
    program = show(name)
    for other in listed:
        if show(other) == program:
            return UserMessage(
                "{program} was uploaded in {encoding} but is listed in {other_encoding}",
                program=program,
                encoding=_encoding(name),
                other_encoding=_encoding(other),
            )
    for other in (*listed, *robot.history.deleted):
        if other.lower() == name.lower():
            return UserMessage(
                "{program} was uploaded but is not listed; {other} was {what}: the names differ"
                " only in case",
                program=program,
                other=show(other),
                what=UserMessage("listed" if other in listed else "deleted"),
            )
    return UserMessage("{program} was uploaded but is not listed", program=program)


def _encoding(name: bytes) -> str:
    """Return the encoding in which `show` reads a name (A-T-2)."""
    try:
        name.decode()
    except UnicodeDecodeError:
        return "GBK"
    return "UTF-8"


@rule("4.10/11", "4.11/3", on=Exchange, names=_LIST)
def deleted_is_not_listed(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A program that was deleted is not in the list (L246, L260)."""
    if not _is_complete(x, robot) or not robot.history.deleted:
        return None
    deletions = list(deletions_of(listed_names(x), list_begun_ns(x), robot))
    if not deletions:
        return PASSED
    return failed(
        UserMessage(
            "{program} was deleted but is still listed",
            program=show(deletions[0].request.text),
        ),
        expected="not in the list",
        observed="in the list",
        at=(*places_of(deletions[0]), *places_of(x)),
    )


def deletions_of(names: list[bytes], before_ns: int, robot: RobotState) -> Iterator[Exchange]:
    """Yield the deletions of these names that were answered before this time."""
    for name in names:
        deletion = robot.history.deleted.get(name)
        if deletion and answered_ns(deletion) < before_ns:
            yield deletion


@rule("4.11/3", on=Exchange, names=("download_name", *_RUNS))
def deleted_is_gone(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A deleted program cannot be downloaded or run (L260); a run may fail late (A-4.15-1)."""
    deletion = next(deletions_of([x.request.text], x.time_ns, robot), None)
    if deletion is None or x.accepted is None:
        return None
    failed_late = x.outcome is not None and not x.outcome.done
    if not x.accepted or failed_late:
        return PASSED
    if x.command and x.command.two_stage and x.outcome is None:
        return None
    return failed(
        UserMessage(
            "{program} was deleted, but {command} was accepted for it",
            program=show(x.request.text),
            command=x.name,
        ),
        expected="0",
        observed="1",
        at=(*places_of(deletion), *places_of(x)),
    )


@rule("4.11/4", on=Exchange, names=("delete_program",))
def deleted_once(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A program that was deleted is not stored: its second deletion is answered "0" (L260)."""
    deletion = next(deletions_of([x.request.text], x.time_ns, robot), None)
    if deletion is None or x.accepted is None:
        return None
    if not x.accepted:
        return PASSED
    if x.time_ns - answered_ns(deletion) > MAX_UNSEEN_NS:
        return None
    return failed(
        UserMessage(
            "{program} was deleted twice with success, without an upload between",
            program=show(x.request.text),
        ),
        expected="0",
        observed="1",
        at=(*places_of(deletion), *places_of(x)),
    )


@rule("4.11/2", on=Exchange, names=_LIST)
def refused_deletion_keeps(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A program whose deletion was answered "0" is still listed (L260)."""
    refused = robot.history.last("delete_program", before_ns=x.time_ns)
    before = robot.history.last("list_programs", before_ns=refused.time_ns) if refused else None
    if refused is None or refused.accepted is not False or before is None:
        return None
    if robot.history.last_requests.get("delete_program") is not refused.request:
        return None
    if not _is_complete(x, robot) or answered_ns(refused) > list_begun_ns(x):
        return None
    name = refused.request.text
    unseen = x.time_ns - before.time_ns > MAX_UNSEEN_NS or name in robot.history.deleted
    uploaded = robot.history.uploaded_ns.get(name, -1) >= before.time_ns
    if unseen or uploaded or name not in listed_names(before):
        return None
    if name in listed_names(x):
        return PASSED
    return failed(
        UserMessage(
            "the deletion of {program} was answered 0, but it is not listed any more",
            program=show(name),
        ),
        expected="1",
        observed="0",
        at=(*places_of(before), *places_of(refused), *places_of(x)),
    )


@rule("4.11/5", on=Exchange, names=("delete_program",))
def running_is_not_deleted(x: Exchange, _: RobotState) -> RuleResult | None:
    """The running program is not deleted (A-4.11-1)."""
    running = any(y.name in _RUNS and y.request_value == x.request_value for y in x.concurrent)
    if not running or x.concurrent_uncertain or x.accepted is None:
        return None
    if not x.accepted:
        return PASSED
    return tolerated(
        "delete_guard",
        "allow",
        UserMessage("{program} was deleted while it ran", program=show(x.request_value or b"")),
    )
