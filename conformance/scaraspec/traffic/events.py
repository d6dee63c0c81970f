"""Traffic events: frames, exchanges, transfers, and what belongs to none of them.

A `Dialogue` makes them from wire events, in order of time; rules and sinks read them. An event does
not change after the dialogue has returned it. `certain` is False if a capture gap or an injected
fault may have affected the event; such an event never causes a failure.
"""

from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from scaraspec.protocol.commands import Command, Parsed
from scaraspec.protocol.frames import Frame, SkipReason
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.protocol.transfer import Chunk, TransferState
from scaraspec.traffic.wire import WireEvent, WireRange


@dataclass(frozen=True, slots=True)
class FrameSeen:
    """A frame, its place on the wire, and its payload as decoded by the command table.

    Attributes:
        frame: The frame.
        place: Where it is, and when it was complete.
        begun_ns: When its first byte was seen.
        parsed: Command, part and decoded payload; None for an undefined opcode or tag.
        certain: It is certainly a frame: the stream was in sync, and no gap can have created it.
        pause_ns: The longest time without bytes between its first and its last byte.
    """

    frame: Frame
    place: WireRange
    begun_ns: int
    parsed: Parsed | None
    certain: bool = True
    pause_ns: int = 0

    @property
    def command(self) -> Command | None:
        """The command table's row, or None."""
        return self.parsed.command if self.parsed else None

    @property
    def name(self) -> str:
        """The command's name, or the undefined opcode."""
        return self.parsed.command.name if self.parsed else f"0x{self.frame.opcode:02X}"

    @property
    def value(self) -> Any:
        """The decoded value; None without one."""
        return self.parsed.decoded.value if self.parsed else None

    @property
    def text(self) -> bytes:
        """The data of a text payload, without a trailing NUL (A-T-3)."""
        return self.frame.data.rstrip(b"\0")


@dataclass(frozen=True, slots=True)
class InvalidBytes:
    """A run of consecutive bytes that are not a frame.

    Attributes:
        data: At most the first 4096 bytes.
        reason: Why they belong to no frame.
        place: Where they are, their full length, and when the last of them was seen.
        touches_gap: Whether they may be part of a frame that a capture gap cuts.
        mixed: The commands of two frames whose bytes are mixed, if that explains them.
    """

    data: bytes
    reason: SkipReason
    place: WireRange
    touches_gap: bool = False
    mixed: str = ""

    @property
    def certain(self) -> bool:
        """Whether they certainly are not a frame."""
        return not self.touches_gap


@dataclass(frozen=True, slots=True)
class LinkChange:
    """The connection was opened, half-closed, closed or reset."""

    event: WireEvent


@dataclass(frozen=True, slots=True)
class CaptureGap:
    """Bytes are missing, or may be: nothing that depends on them can be judged."""

    event: WireEvent


@dataclass(frozen=True, slots=True)
class Injected:
    """A fault was injected on purpose: the receiver did not get the bytes as they were sent."""

    event: WireEvent


class Ending(Enum):
    """How an exchange ended. Every exchange leaves `OPEN` once, and then does not change again.

    ========== ========================================================== ===================
    to         event                                                      set by
    ========== ========================================================== ===================
    ANSWERED   the reply, last list part or final result arrived          `Dialogue`
    UNANSWERED the reply timeout expired                                  `PendingRequests`
    CUT_OFF    the link, the capture or the transfer ended before         all three
    HUNG_UP    the peer that owes the reply closed the link               `PendingRequests`
    UNSEEN     a capture gap may hide the reply, or too many are pending  all three
    UNFINISHED idle, or the next command, without a final result          `PendingResults`
    ========== ========================================================== ===================
    """

    OPEN = "open"
    ANSWERED = "answered"
    UNANSWERED = "unanswered"
    UNFINISHED = "unfinished"
    CUT_OFF = "cut off"
    HUNG_UP = "hung up"
    UNSEEN = "unseen"


@dataclass(eq=False, slots=True)
class Exchange:
    """A request and everything that answers it.

    The fields are grouped by the class that sets them. `certain` is the only field that several
    classes set: each may only change it to False.
    """

    # The request; set by `Dialogue` when it arrives.
    request: FrameSeen
    command: Command | None
    """The command table's row; None for an undefined opcode."""
    name: str = field(init=False)
    """The command's name, or the undefined opcode. Stored because every rule reads it."""

    # What answers it; set by `Dialogue`, the result by `PendingResults`.
    reply: FrameSeen | None = None
    """The first reply; for a list in parts, the first part."""
    result: FrameSeen | None = None
    """The final result of a two-stage command."""
    parts: list[FrameSeen] = field(default_factory=list)
    """All parts of a program list up to this exchange."""
    malformed: InvalidBytes | None = None
    """Invalid bytes in the place of the reply or of the final result."""
    unmatched_reply: FrameSeen | None = None
    """The first reply without a request that arrived while this exchange was unanswered."""
    mismatched: bool = False
    """It and the request before or after it were each followed only by another opcode's reply."""
    ending: Ending = Ending.OPEN
    certain: bool = True
    """Whether no capture gap, injected fault or other request can have affected it."""

    # Access; set by `Dialogue` when the request arrives.
    logged_in: bool | None = None
    """Whether the connection had logged in; None if the capture does not show it."""
    login_sent_before: bool = False
    """Whether a login had been sent before on the connection."""
    refused_login: FrameSeen | None = None
    """The refusal of the last login, if no login had succeeded."""

    # Overlap with other requests; set by `PendingRequests`.
    same_opcode_pending: bool = False
    """A request with the same opcode was unanswered when this one was sent."""
    pipelined: bool = False
    """An earlier request, sent in another segment, was within its reply timeout."""
    overtaken_by: FrameSeen | None = None
    """The first reply to a later request that arrived while this one was unanswered."""
    overdue: bool = False
    """It was overtaken, and its own reply arrived after the reply timeout."""
    requested_again: FrameSeen | None = None
    """For a late reply: the request with the same opcode that followed the reply timeout."""
    ambiguous: bool = False
    """Its reply may answer an earlier or later request with its opcode."""

    # Execution; set by `PendingResults`.
    concurrent: tuple["Exchange", ...] = ()
    """The two-stage commands that executed from the request to the reply (until the reply: at the
    request). In a two-stage command these are copies, made when it was accepted."""
    concurrent_uncertain: bool = False
    """Whether `concurrent` may be wrong, or changed between request and reply."""
    state_version: int = 0
    """`RobotState.version` at the request."""
    idle_status: FrameSeen | None = None
    """The first status 00 that arrived while this two-stage command executed."""
    lag_ns: int = 0
    """For how long after its first reply a status 00 was requested that may be old (A-4.8-3)."""
    stop_requested: bool = False
    """An emergency stop was requested, or its client hung up, while it executed."""
    interrupted_by: "Exchange | None" = None
    """A copy of the accepted stop that interrupted it; for a jog also the next jog."""
    result_after_stop: bool = False
    """Its final result arrived after that of the stop."""

    plain: bool = False
    """Whether it is a query with its reply, and nothing else happened from one to the other; set by
    `Dialogue`. `bytes_key` then states everything about it except its place and times."""

    # File transfer; set by `TransferTracker`.
    transfer: "Transfer | None" = None
    """The transfer that it begins or belongs to."""
    previous_transfer: "Transfer | None" = None
    """For a chunk outside a transfer: the last transfer in this direction on the connection.

    It may be one whose name was refused."""
    after_silence: bool = False
    """A chunk after a silence in which the transfer may have timed out (A-5-13)."""
    chunk: Chunk | None = None
    """The structure, decoded in the byte order of its transfer."""
    expected_position: int | None = None
    """For a chunk: the position that follows the chunks before it, as far as they are known."""

    def __post_init__(self) -> None:
        self.name = self.request.name

    def set_ambiguous(self) -> None:
        """Note that its reply may answer another request: nothing certain follows from it."""
        self.ambiguous, self.certain = True, False

    @property
    def bytes_key(self) -> tuple[object, ...]:
        """The frames, and whether a login had been sent before."""
        reply = self.reply.frame if self.reply else None
        return self.request.frame, reply, self.login_sent_before

    @property
    def overtaken(self) -> bool:
        """Whether a later request was answered while this one was unanswered."""
        return self.overtaken_by is not None

    @property
    def request_value(self) -> Any:
        """The decoded value of the request."""
        return self.request.value

    @property
    def reply_value(self) -> Any:
        """The decoded value of the first reply; None without a reply."""
        return self.reply.value if self.reply else None

    @property
    def accepted(self) -> bool | None:
        """Whether the first reply accepts the request; None if there is none or it has no flag."""
        value = self.reply_value
        if isinstance(value, Acceptance):
            return value.accepted
        return value if isinstance(value, bool) else None

    @property
    def outcome(self) -> Outcome | None:
        """The decoded final result."""
        value = self.result.value if self.result else None
        return value if isinstance(value, Outcome) else None

    @property
    def error_signal(self) -> bool:
        """Whether this chunk has length 0 or no data: the sender gives up (L787)."""
        return not self.request.frame.data or (self.chunk is not None and not self.chunk.length)

    @property
    def latency_ns(self) -> int | None:
        """Time from the request's last byte to the reply's first byte."""
        return self.reply.begun_ns - self.request.place.time_ns if self.reply else None

    @property
    def duration_ns(self) -> int | None:
        """Execution time: from the first reply to the final result."""
        if not self.reply or not self.result:
            return None
        return self.result.begun_ns - self.reply.place.time_ns

    @property
    def time_ns(self) -> int:
        """When the request was complete."""
        return self.request.place.time_ns

    @property
    def frames(self) -> tuple[FrameSeen, ...]:
        """All its frames, in order."""
        seen = [self.request, *self.parts] if self.parts else [self.request, self.reply]
        return tuple(f for f in (*seen, self.result) if f)


@dataclass(eq=False, slots=True)
class Transfer:
    """One file transfer: an upload (0x50, 0x52) or a download (0x54, 0x56).

    `TransferTracker` sets all fields.

    Attributes:
        upload: Whether the file goes to the controller.
        name: The file name, as sent.
        begun_ns: When the name was sent, and from its acceptance on, when it was accepted.
        opening: The exchange with the name; None if the capture began later.
        size_bytes: fileSize of the first chunk; -1 before it.
        order: The byte order that the chunks prove: "little", "big", or "" if none does.
        chunks: Number of chunks that were sent.
        content: The file from its start, as far as acknowledged chunks are contiguous; cut at a
            limit.
        received_bytes: Number of these bytes, also beyond the limit.
        whole_content: Whether `content` contains all `received_bytes`.
        last_chunk: The last accepted chunk.
        resumed: The sender continued after a chunk had been refused (A-5-14).
        extra_reply_seen: A reply was sent without a pending chunk: the sender may take it for the
            reply to its next chunk.
        first_difference: For a download of a file whose content is known: position of the first
            byte that differs; -1 if none does.
        differing_chunk: The chunk with this byte.
        state: Whether it is active, complete or failed.
        reason: Why it failed, or why its end is not known.
        ended_ns: When it ended.
        certain: Whether no capture gap can have affected it.
    """

    upload: bool
    name: bytes
    begun_ns: int
    opening: Exchange | None = None
    size_bytes: int = -1
    order: str = ""
    chunks: int = 0
    content: bytearray = field(default_factory=bytearray)
    received_bytes: int = 0
    whole_content: bool = True
    last_chunk: FrameSeen | None = None
    resumed: bool = False
    extra_reply_seen: bool = False
    first_difference: int = -1
    differing_chunk: FrameSeen | None = None
    state: TransferState = TransferState.ACTIVE
    reason: str = ""
    ended_ns: int = 0
    certain: bool = True


@dataclass(frozen=True, slots=True)
class UnsolicitedReply:
    """A reply or a final result without a pending request or command.

    Attributes:
        seen: The frame.
        after: The last answered exchange of that command on the connection, if there was one.
        waiting: The requests that were unanswered at that time.
        certain: Whether no capture gap can hide the request that it answers.
        late: It may answer a request that timed out or could not be decoded.
        elsewhere: A final result whose command was requested on another connection (A-2-9).
    """

    seen: FrameSeen
    after: Exchange | None
    waiting: tuple[Exchange, ...]
    certain: bool
    late: bool = False
    elsewhere: bool = False


TrafficEvent = (
    FrameSeen
    | InvalidBytes
    | LinkChange
    | CaptureGap
    | Injected
    | Exchange
    | Transfer
    | UnsolicitedReply
)
