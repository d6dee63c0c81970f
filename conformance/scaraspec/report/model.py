"""The results model: everything a report says, as typed values that round-trip results.json.

Here is what results are, and how they are read and written; who makes them (`audit`, the suite)
and how they look (`html`, `terminal`, `junit`, `ctrf`) is elsewhere. The form of the file is a
promise to other programs: a change that could break one of them makes a new schema number.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from importlib import metadata
from pathlib import Path
from typing import Any, Final, NoReturn

from scaraspec.judge.verdicts import Cause, Conclusion, Verdict
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.codec import MisfitError, from_plain, to_plain
from scaraspec.report.files import write_whole
from scaraspec.user_message import UserMessage

SCHEMA: Final = "scaraspec.results/1"
SEEN: Final = ".seen-"
"""In the id of what the judge saw on the wire, whichever case was tried meanwhile."""
_LARGEST_FILE_BYTES: Final = 512 * 2**20


class ResultsError(Exception):
    """A file that cannot be read as results; the message is one sentence for the user."""


class Role(Enum):
    """What was judged: one implementation, or both sides of a recording."""

    CONTROLLER = "controller"
    CLIENT = "client"
    CAPTURE = "capture"


@dataclass(frozen=True, slots=True)
class Tool:
    """What judged."""

    name: str
    version: str

    @classmethod
    def own(cls) -> "Tool":
        """This tool."""
        return cls("scaraspec", metadata.version("scaraspec"))


@dataclass(frozen=True, slots=True)
class Subject:
    """What was judged, as far as that is known; empty where it is not.

    Attributes:
        kind: What it is.
        name: As its statement of conformance calls it.
        version: The version that it claims or reports.
        link: Where it was reached, such as ``tcp://192.168.1.2``.
        file: The capture's file; of a run, the one that was recorded beside the results.
        claims: What else its statement of conformance claims.
        complaints: The end of what its process complained of.
    """

    kind: Role
    name: str = ""
    version: str = ""
    link: str = ""
    file: str = ""
    claims: Mapping[str, str] = field(default_factory=dict)
    complaints: str = ""

    @property
    def title(self) -> str:
        """What to call it."""
        return self.name or self.link or self.file


@dataclass(frozen=True, slots=True)
class ReadingSeen:
    """What one party does at one open point of the document.

    Attributes:
        options: The options seen, the most frequent first; empty where it was only claimed.
        default: Whether exactly the register's default was seen.
        mixed: Whether options were seen that exclude each other.
        claimed: The option that the statement of conformance names; None where it is silent.
    """

    options: tuple[str, ...]
    default: bool
    mixed: bool
    claimed: str | None = None


@dataclass(frozen=True, slots=True)
class FrameField:
    """A part of a frame: where it begins in it, how long it is, what it says."""

    name: str
    offset_bytes: int
    length_bytes: int
    value: str = ""


@dataclass(frozen=True, slots=True)
class Evidence:
    """Bytes on the wire that a case rests on.

    Attributes:
        connection: Names the connection within the recording.
        direction: Who sent them.
        offset_bytes: Where they begin in the stream of that direction.
        length_bytes: How many they are.
        time_ns: When the last of them passed, in nanoseconds since the Unix epoch.
        note: What they are, such as ``run_program, final result``.
        frame_hex: The bytes in upper-case hex without blanks, passwords as ``2A``; empty where
            they were not kept, and only the beginning of very long ones.
        fields: The parts of the frame, in order; empty for bytes that are no frame.
    """

    connection: str
    direction: Direction
    offset_bytes: int
    length_bytes: int
    time_ns: int
    note: str = ""
    frame_hex: str = ""
    fields: tuple[FrameField, ...] = ()

    @property
    def place(self) -> str:
        """Where it is, in short: ``connection 1, A2C byte 239, 216 bytes``."""
        return (
            f"connection {self.connection}, {self.direction.value} "
            f"byte {self.offset_bytes}, {self.length_bytes} bytes"
        )


@dataclass(frozen=True, slots=True)
class Case:
    """One thing that was tried or, in a capture, one thing that was found.

    Attributes:
        id: Its requirement, with a short suffix where a requirement has several cases.
        requirements: The ids of the requirements that it judges.
        verdict: What was found.
        cause: Who is responsible where it is no pass.
        hazard: The worst that trying it could do to a real robot.
        message: One sentence for a reader who has not seen the traffic.
        expected: What the requirement leads to expect.
        observed: What was there instead.
        duration_s: How long it took, in seconds; 0 for what was found in a capture.
        examples: For how many values it was tried, each judged by itself; 0 for one thing.
        replay: One command line that shows it again.
        wire: The evidence, in order of time within each occurrence.
        passing: Of a failure: the last exchange of the same command that was right.
    """

    id: str
    requirements: tuple[str, ...]
    verdict: Verdict
    cause: Cause | None = None
    hazard: Hazard = Hazard.READ_ONLY
    message: str = ""
    expected: str = ""
    observed: str = ""
    duration_s: float = 0.0
    examples: int = 0
    replay: str = ""
    wire: tuple[Evidence, ...] = ()
    passing: tuple[Evidence, ...] = ()


@dataclass(frozen=True, slots=True)
class RequirementResult:
    """A requirement in scope: its gravest verdict, ``none`` where no case judged it."""

    id: str
    verdict: Verdict
    cases: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Timing:
    """How long something took, over many times; all in milliseconds.

    Attributes:
        count: How many were measured.
        min_ms: The shortest, exact.
        p50_ms: The median, within 2.2 %.
        p99_ms: What 99 of 100 do not exceed, within 2.2 %.
        max_ms: The longest, exact.
        bins: A histogram: where each bin that is not empty begins, and how many fell into it.
            Four bins double the time; the first begins at 0.001 and holds all below, too.
    """

    count: int
    min_ms: float
    p50_ms: float
    p99_ms: float
    max_ms: float
    bins: tuple[tuple[float, int], ...]


@dataclass(frozen=True, slots=True)
class CommandSeen:
    """All exchanges of one command.

    Attributes:
        name: The command, or the undefined opcode.
        count: How many.
        refused: How many were answered with a refusal.
        endings: How many ended in each way that is not ``answered``.
        latency: From the request's last byte to the first reply's first.
        duration: From the first reply to the final result.
    """

    name: str
    count: int
    refused: int
    endings: Mapping[str, int]
    latency: Timing | None = None
    duration: Timing | None = None


@dataclass(frozen=True, slots=True)
class ConnectionSeen:
    """One connection; `note` holds its addresses where they are known."""

    name: str
    begun_ns: int
    ended_ns: int
    bytes: Mapping[Direction, int]
    frames: int
    ending: str
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferSeen:
    """One file transfer; `size_bytes` is -1 where no chunk said it."""

    name: str
    upload: bool
    begun_ns: int
    duration_ms: float
    size_bytes: int
    received_bytes: int
    chunks: int
    order: str
    state: str
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSeen:
    """One run of a user program; `code` is one of table 8-1 where it was refused or failed."""

    name: str
    simulated: bool
    begun_ns: int
    duration_ms: float | None
    outcome: str
    code: str = ""


@dataclass(frozen=True, slots=True)
class Loss:
    """Bytes that passed unseen; `length_bytes` is -1 where their number is not known."""

    connection: str
    direction: Direction
    offset_bytes: int
    length_bytes: int
    time_ns: int
    note: str = ""


@dataclass(frozen=True, slots=True)
class Session:
    """What happened on the wire, whatever was right or wrong with it.

    Attributes:
        begun_ns: When the first thing happened.
        ended_ns: When the last thing happened.
        bytes: Bytes seen of each direction.
        frames: Frames seen.
        undecodable_bytes: Bytes that are part of no frame.
        connections: The connections, in order.
        exchanges: The commands used, by name.
        transfers: The file transfers, in order of their end.
        runs: The runs of user programs, in order of their end.
        losses: The gaps in the recording.
        unlisted: How many connections, transfers, runs and losses there were beyond those listed.
    """

    begun_ns: int
    ended_ns: int
    bytes: Mapping[Direction, int]
    frames: int
    undecodable_bytes: int
    connections: tuple[ConnectionSeen, ...] = ()
    exchanges: tuple[CommandSeen, ...] = ()
    transfers: tuple[TransferSeen, ...] = ()
    runs: tuple[RunSeen, ...] = ()
    losses: tuple[Loss, ...] = ()
    unlisted: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """Everything a report says.

    Attributes:
        tool: What judged.
        subject: What was judged.
        role: The part that it plays.
        verdict: What the run amounts to.
        counts: Cases by verdict.
        readings: For ``client`` and ``controller``: what each does at the open points, by key.
        requirements: The requirements in scope, in the order of the document.
        cases: The cases, in the order of the document.
        session: What happened on the wire, where that is known.
        notices: What the reader must know before the verdict, such as that the emergency stop
            does not work or that an interrupted run was recovered.
    """

    tool: Tool
    subject: Subject
    role: Role
    verdict: Conclusion
    counts: Mapping[Verdict, int]
    readings: Mapping[str, Mapping[str, ReadingSeen]]
    requirements: tuple[RequirementResult, ...]
    cases: tuple[Case, ...]
    session: Session | None = None
    notices: tuple[str, ...] = ()

    @property
    def judged(self) -> int:
        """How many requirements were decided: an inconclusive one was not."""
        decided = (Verdict.PASS, Verdict.TOLERATED, Verdict.FAIL)
        return sum(each.verdict in decided for each in self.requirements)

    @property
    def examples(self) -> int:
        """How many values all cases were tried for."""
        return sum(case.examples for case in self.cases)

    def to_json(self) -> str:
        """The text of results.json: keys sorted, so that equal results are equal bytes."""
        plain = {"schema": SCHEMA, **to_plain(self)}
        text = json.dumps(plain, ensure_ascii=False, allow_nan=False, indent=1, sort_keys=True)
        return text + "\n"

    def write(self, path: Path) -> None:
        """Write results.json, whole or not at all.

        Raises:
            OSError: It cannot be written.
        """
        write_whole(path, self.to_json())

    @classmethod
    def read(cls, path: Path) -> "Results":
        """Read results.json.

        Raises:
            ResultsError: It cannot be read, is no results file, is torn or damaged, or is of
                another schema version.
        """
        try:
            with path.open("rb") as file:
                raw = file.read(_LARGEST_FILE_BYTES + 1)
        except OSError as error:
            raise ResultsError(
                UserMessage(
                    "{path} cannot be read: {value}", path=path, value=error.strerror or error
                )
            ) from None
        if len(raw) > _LARGEST_FILE_BYTES:
            raise ResultsError(
                UserMessage("{path} is larger than results can be; name a results.json", path=path)
            )
        try:
            return cls.from_json(raw)
        except ResultsError as error:
            raise ResultsError(UserMessage("{path} {error}", path=path, error=error)) from None

    @classmethod
    def from_json(cls, text: str | bytes) -> "Results":
        """Read the text of a results.json.

        Raises:
            ResultsError: It is none; the message lacks its subject, the file's name.
        """
        try:
            plain = json.loads(text, parse_constant=_refuse)
        except json.JSONDecodeError as error:
            raise ResultsError(
                UserMessage(
                    "is torn or no results.json: {msg} at line {lineno}",
                    msg=error.msg,
                    lineno=error.lineno,
                )
            ) from None
        except (ValueError, RecursionError):
            raise ResultsError("is no results.json: it is not readable as JSON") from None
        _check_schema(plain)
        try:
            return from_plain(cls, plain)
        except MisfitError as misfit:
            raise ResultsError(UserMessage("is damaged: {misfit}", misfit=misfit)) from None


def _refuse(constant: str) -> NoReturn:
    raise ValueError(constant)


def _check_schema(plain: Any) -> None:
    schema = plain.get("schema") if isinstance(plain, dict) else None
    if schema == SCHEMA:
        return
    if isinstance(schema, str) and schema.startswith(SCHEMA.rpartition("/")[0] + "/"):
        raise ResultsError(
            UserMessage(
                "is of schema {schema!r} and this scaraspec reads {schema_2}: read it with "
                "the version that wrote it",
                schema=schema[:40],
                schema_2=SCHEMA,
            )
        )
    raise ResultsError(
        UserMessage('is no results.json: it does not say "schema": "{schema}"', schema=SCHEMA)
    )
