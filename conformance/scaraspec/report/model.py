"""The results model: the content of a report as typed values, stored in results.json.

This module defines, reads and writes results. `audit` and the suite create them; `html`,
`terminal`, `junit` and `ctrf` show them. The format of the file is a public interface: an
incompatible change needs a new schema number.
"""

import json
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from importlib import metadata
from pathlib import Path
from typing import Any, Final, NoReturn

from scaraspec.judge.verdicts import Cause, Conclusion, Reason, Side, Verdict
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.codec import InvalidValueError, from_plain, to_plain
from scaraspec.report.failed_step import AttemptResult, FailedStep, RootCause, SittingResult
from scaraspec.report.files import write_whole
from scaraspec.report.operator_request import OperatorRequest
from scaraspec.user_message import UserMessage

SCHEMA: Final = "scaraspec.results/2"
_READABLE: Final = ("scaraspec.results/1", SCHEMA)
SEEN: Final = ".seen-"
"""Part of the id of a finding of the judge on the wire during a run."""
_MAX_FILE_BYTES: Final = 512 * 2**20


class ResultsError(Exception):
    """A file cannot be read as results; the message is one sentence for the user."""


class Role(Enum):
    """What was judged: one implementation, or both sides of a recording."""

    CONTROLLER = "controller"
    CLIENT = "client"
    CAPTURE = "capture"


@dataclass(frozen=True, slots=True)
class Tool:
    """The tool that produced the results."""

    name: str
    version: str

    @classmethod
    def own(cls) -> "Tool":
        """Return this tool with its version."""
        return cls("scaraspec", metadata.version("scaraspec"))


@dataclass(frozen=True, slots=True)
class RunInfo:
    """How the results were produced.

    Attributes:
        begun_ns: The start of the run, in nanoseconds since the Unix epoch.
        ended_ns: The end of the run.
        seed: The seed of all drawn values.
        settings: The settings of the run by name, such as ``allow`` and ``transfer_timeout_s``.
        python: The version of Python.
        platform: The operating system and the processor architecture.
    """

    begun_ns: int
    ended_ns: int
    seed: int
    settings: Mapping[str, str] = field(default_factory=dict)
    python: str = field(default_factory=platform.python_version)
    platform: str = field(default_factory=lambda: f"{platform.system()} {platform.machine()}")


@dataclass(frozen=True, slots=True)
class Subject:
    """The system under test; unknown attributes are empty.

    Attributes:
        kind: The role of the SUT.
        name: The name in its ICS.
        version: The version that it claims or reports.
        link: The link URL, such as ``tcp://192.168.1.2``.
        file: The capture file; for a run, the recording next to the results.
        claims: The other claims of its ICS.
        complaints: The end of the error output of its process.
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
        """The name for users: the name, else the link, else the file."""
        return self.name or self.link or self.file


@dataclass(frozen=True, slots=True)
class ReadingSeen:
    """The observed reading of one side for one open point.

    Attributes:
        options: The observed options, the most frequent first; empty if it was only claimed.
        default: Whether exactly the default of the register was observed.
        mixed: Whether contradictory options were observed.
        claimed: The option claimed in the ICS; None without a claim.
    """

    options: tuple[str, ...]
    default: bool
    mixed: bool
    claimed: str | None = None


@dataclass(frozen=True, slots=True)
class FrameField:
    """A part of a frame: name, offset in the frame, length and value."""

    name: str
    offset_bytes: int
    length_bytes: int
    value: str = ""


@dataclass(frozen=True, slots=True)
class Evidence:
    """Bytes on the wire that support the verdict of a case.

    Attributes:
        connection: The name of the connection in the recording.
        direction: The sender of the bytes.
        offset_bytes: The offset in the stream of that direction.
        length_bytes: The number of bytes.
        time_ns: The time of the last byte, in nanoseconds since the Unix epoch.
        note: A description, such as ``run_program, final result``.
        frame_hex: The bytes in upper-case hex, passwords as ``2A``; cut if long, empty if not kept.
        fields: The parts of the frame, in order; empty for invalid bytes.
        packet: The number of its first packet, or message of an MCAP file, from 1; 0 if unknown.
    """

    connection: str
    direction: Direction
    offset_bytes: int
    length_bytes: int
    time_ns: int
    note: str = ""
    frame_hex: str = ""
    fields: tuple[FrameField, ...] = ()
    packet: int = 0

    @property
    def place(self) -> str:
        """The position in short form: ``connection 1, A2C byte 239, 216 bytes``."""
        return UserMessage(
            "connection {connection}, {direction} byte {offset_bytes}, {length_bytes} bytes",
            connection=self.connection,
            direction=self.direction.value,
            offset_bytes=self.offset_bytes,
            length_bytes=self.length_bytes,
        )


@dataclass(frozen=True, slots=True)
class Case:
    """One test case or, for a capture, one finding.

    Attributes:
        id: The requirement, with a short suffix if the requirement has several cases.
        requirements: The ids of the requirements that the case judges.
        verdict: The verdict.
        cause: Who is responsible if the case did not pass.
        hazard: The worst effect of the case on a real robot.
        message: One sentence that is understandable without the traffic.
        expected: The expected behaviour.
        observed: The observed behaviour.
        duration_s: The duration in seconds; 0 for a finding in a capture.
        begin_ns: When the case began, in nanoseconds since the Unix epoch, on the clock of the
            capture; 0 for a finding in a capture.
        examples: The number of values tried, each with its own verdict; 0 for a single try.
        replay: The reproduction command.
        wire: The evidence, in order of time within each occurrence.
        passing: For a failure, the last passing exchange of the same command.
        attempts: The results of all attempts, if the case was tried several times.
        reason: Why the verdict is none or inconclusive.
        lines: The lines of the document that state the first requirement, such as ``L397``.
        fingerprint: A hash that is equal for equal findings of different runs.
        title: What the case tries, or the requirement of a finding, in one line.
        step: The step that failed, or whose observation is inconclusive; None otherwise.
        date: The start of the sitting of the case in UTC, as ISO 8601, if there are several.
        sittings: What each sitting found, if several ran the case and were merged.
        operator: What an operator was asked to do, and the answers; not part of the duration.
        side: What a finding is about: client, controller, network or recording; None for both sides
            and for a case of the suite.
        moment: For a finding in a capture: where it shows, the last evidence of the first
            occurrence.
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
    attempts: tuple[AttemptResult, ...] = ()
    reason: Reason | None = None
    lines: str = ""
    fingerprint: str = ""
    title: str = ""
    step: FailedStep | None = None
    date: str = ""
    sittings: tuple[SittingResult, ...] = ()
    operator: tuple[OperatorRequest, ...] = ()
    side: Side | None = None
    moment: Evidence | None = None
    begin_ns: int = 0


@dataclass(frozen=True, slots=True)
class RequirementResult:
    """A requirement in scope: its worst verdict, ``none`` if no case judged it."""

    id: str
    verdict: Verdict
    cases: tuple[str, ...] = ()

    @property
    def decided(self) -> bool:
        """Whether the verdict is pass, tolerated or fail."""
        return self.verdict in (Verdict.PASS, Verdict.TOLERATED, Verdict.FAIL)


@dataclass(frozen=True, slots=True)
class Timing:
    """Statistics of a duration, in milliseconds.

    Attributes:
        count: The number of measurements.
        min_ms: The minimum, exact.
        p50_ms: The median, within 2.2 %.
        p99_ms: The 99th percentile, within 2.2 %.
        max_ms: The maximum, exact.
        bins: A histogram: the start and the count of each non-empty bin. There are four bins per
            factor of two; the first one starts at 0.001 and includes smaller values.
        p95_ms: The 95th percentile, within 2.2 %; None in results that were written without it.
    """

    count: int
    min_ms: float
    p50_ms: float
    p99_ms: float
    max_ms: float
    bins: tuple[tuple[float, int], ...]
    p95_ms: float | None = None


@dataclass(frozen=True, slots=True)
class CommandSeen:
    """All exchanges of one command.

    Attributes:
        name: The command, or the undefined opcode.
        count: The number of exchanges.
        refused: The number of refused requests.
        endings: The number of exchanges for each ending other than ``answered``.
        latency: From the last byte of the request to the first byte of the first reply.
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
    """One connection; `note` contains its addresses if they are known."""

    name: str
    begun_ns: int
    ended_ns: int
    bytes: Mapping[Direction, int]
    frames: int
    ending: str
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferSeen:
    """One file transfer; `size_bytes` is -1 if no chunk contained the size."""

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
    """One run of a user program; `code` is a code of table 8-1 if it was refused or failed."""

    name: str
    simulated: bool
    begun_ns: int
    duration_ms: float | None
    outcome: str
    code: str = ""


@dataclass(frozen=True, slots=True)
class Loss:
    """Bytes missing in the recording; `length_bytes` is -1 if their number is unknown."""

    connection: str
    direction: Direction
    offset_bytes: int
    length_bytes: int
    time_ns: int
    note: str = ""


@dataclass(frozen=True, slots=True)
class Session:
    """The traffic on the wire, independent of verdicts.

    Attributes:
        begun_ns: The time of the first event.
        ended_ns: The time of the last event.
        bytes: The number of bytes in each direction.
        frames: The number of frames.
        undecodable_bytes: The number of bytes that belong to no frame.
        connections: The connections, in order.
        exchanges: The commands used, by name.
        transfers: The file transfers, in order of their end.
        runs: The runs of user programs, in order of their end.
        losses: The gaps in the recording.
        unlisted: The numbers of connections, transfers, runs and losses that are not listed.
        lost_bytes: The number of bytes in all gaps of known length.
        incomplete: Whether the file is damaged, or ends before the recording did.
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
    lost_bytes: int = 0
    incomplete: bool = False

    @property
    def missing(self) -> str:
        """What is missing in the recording: ``3 losses, 1,482 bytes``; empty if nothing is."""
        losses = len(self.losses) + self.unlisted.get("losses", 0)
        parts: list[str] = []
        if losses:
            text = "1 loss" if losses == 1 else "{count} losses"
            parts.append(UserMessage(text, count=f"{losses:,}"))
        if self.lost_bytes:
            text = "{count} byte" if self.lost_bytes == 1 else "{count} bytes"
            parts.append(UserMessage(text, count=f"{self.lost_bytes:,}"))
        if any(loss.length_bytes < 0 for loss in self.losses):
            text = "and more of unknown length" if self.lost_bytes else "of unknown length"
            parts.append(UserMessage(text))
        if self.incomplete:
            parts.append(UserMessage("the file is not whole"))
        return UserMessage.listed(parts)


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """The content of a report.

    Attributes:
        tool: The tool that produced the results.
        subject: The system under test.
        role: The role of the SUT.
        verdict: The conclusion of the run.
        counts: Cases by verdict.
        readings: The observed readings of ``client`` and ``controller``, by key.
        requirements: The requirements in scope, in the order of the document.
        cases: The cases, in the order of the document.
        session: The traffic on the wire, if known.
        notices: Sentences before the verdict, such as that the emergency stop does not work.
        run: How the results were produced; None for results of schema 1.
        undecided: The number of findings of the judge that the traffic of a run does not decide,
            by requirement. They have no case and do not count.
        causes: The failures, grouped by their probable cause; empty in files of earlier versions.
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
    run: RunInfo | None = None
    undecided: Mapping[str, int] = field(default_factory=dict)
    causes: tuple[RootCause, ...] = ()

    @property
    def judged(self) -> int:
        """The number of requirements with a decisive verdict; inconclusive is not decisive."""
        return sum(each.decided for each in self.requirements)

    @property
    def missing(self) -> str:
        """What is missing in a capture in which nothing is violated; empty otherwise."""
        recorded = self.role is Role.CAPTURE and self.verdict is Conclusion.INCONCLUSIVE
        return self.session.missing if recorded and self.session else ""

    @property
    def label(self) -> str:
        """The conclusion in words; if not everything was judged, with the coverage."""
        if self.missing:
            return UserMessage(
                "no violation found in what was recorded ({missing})", missing=self.missing
            )
        text: str = UserMessage(self.verdict.value.replace("-", " "))
        if self.verdict is Conclusion.NO_VIOLATION:
            text = UserMessage.joined(
                text,
                " ({judged} of {total} requirements judged)",
                judged=self.judged,
                total=len(self.requirements),
            )
        unsupported = self.subject.claims.get("lacks", "")
        if unsupported and self.verdict.good:
            return UserMessage.joined(text, ", without {unsupported}", unsupported=unsupported)
        return text

    @property
    def examples(self) -> int:
        """The number of values that all cases tried."""
        return sum(case.examples for case in self.cases)

    def to_json(self) -> str:
        """Return the text of results.json; keys are sorted, so equal results give equal bytes."""
        plain = {"schema": SCHEMA, **to_plain(self)}
        text = json.dumps(plain, ensure_ascii=False, allow_nan=False, indent=1, sort_keys=True)
        return text + "\n"

    def write(self, path: Path) -> None:
        """Write results.json atomically.

        Raises:
            OSError: The file cannot be written.
        """
        write_whole(path, self.to_json())

    @classmethod
    def read(cls, path: Path) -> "Results":
        """Read results.json.

        Raises:
            ResultsError: The file cannot be read, is not a results file, is incomplete or
                damaged, or has another schema version.
        """
        try:
            with path.open("rb") as file:
                raw = file.read(_MAX_FILE_BYTES + 1)
        except OSError as error:
            raise ResultsError(
                UserMessage(
                    "{path} cannot be read: {reason}", path=path, reason=error.strerror or error
                )
            ) from None
        if len(raw) > _MAX_FILE_BYTES:
            raise ResultsError(
                UserMessage("{path} is too large for results; name a results.json", path=path)
            )
        try:
            return cls.from_json(raw)
        except ResultsError as error:
            raise ResultsError(UserMessage("{path} {error}", path=path, error=error)) from None

    @classmethod
    def from_json(cls, text: str | bytes) -> "Results":
        """Parse the text of a results.json.

        Raises:
            ResultsError: The text is invalid; the message does not begin with the file name.
        """
        try:
            plain = json.loads(text, parse_constant=_refuse)
        except json.JSONDecodeError as error:
            raise ResultsError(
                UserMessage(
                    "is incomplete or not a results.json: {problem} at line {line}",
                    problem=error.msg,
                    line=error.lineno,
                )
            ) from None
        except (ValueError, RecursionError):
            raise ResultsError("is not a results.json: it is not valid JSON") from None
        _check_schema(plain)
        try:
            return from_plain(cls, plain)
        except InvalidValueError as error:
            raise ResultsError(UserMessage("is damaged: {error}", error=error)) from None


def _refuse(constant: str) -> NoReturn:
    raise ValueError(constant)


def _check_schema(plain: Any) -> None:
    schema = plain.get("schema") if isinstance(plain, dict) else None
    if schema in _READABLE:
        return
    if isinstance(schema, str) and schema.startswith(SCHEMA.rpartition("/")[0] + "/"):
        raise ResultsError(
            UserMessage(
                "has the schema {schema!r}, but this version of scaraspec reads {supported}: "
                "use the version that wrote it",
                schema=schema[:40],
                supported=" and ".join(_READABLE),
            )
        )
    raise ResultsError(
        UserMessage('is not a results.json: "schema" is not "{schema}"', schema=SCHEMA)
    )
