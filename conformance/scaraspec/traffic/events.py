"""The nouns of what happened on a link: frames, exchanges, transfers, and what fits neither.

A `Dialogue` makes them from wire events, in order of time; rules and sinks take them. An object
that has been handed out is not changed again. Each says whether it is `certain`: what is not may
result from a gap in the recording or an injected fault, and is never a failure.
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
    """A frame, where it was, and what the table reads in it.

    Attributes:
        frame: The frame.
        place: Where and when it was complete.
        begun_ns: When its first byte passed.
        parsed: Its row, part and decoded payload; None for an undefined opcode or tag.
        certain: It surely was a frame: the stream was in step, no gap can have made it up.
    """

    frame: Frame
    place: WireRange
    begun_ns: int
    parsed: Parsed | None
    certain: bool = True

    @property
    def command(self) -> Command | None:
        """The row of the table, or None."""
        return self.parsed.command if self.parsed else None

    @property
    def name(self) -> str:
        """The command's name, or the undefined opcode."""
        return self.parsed.command.name if self.parsed else f"0x{self.frame.opcode:02X}"

    @property
    def value(self) -> Any:
        """The decoded value, None where there is none."""
        return self.parsed.decoded.value if self.parsed else None

    @property
    def text(self) -> bytes:
        """The data of a payload that is text, without the NUL that some end it with (A-T-3)."""
        return self.frame.data.rstrip(b"\0")


@dataclass(frozen=True, slots=True)
class InvalidBytes:
    """Bytes that are no frame, in one run.

    Attributes:
        data: At most the first 4096 of them.
        reason: Why they belong to no frame.
        place: Where they are, their full length, and when the last of them passed.
        touches_gap: Whether they may be part of a frame that a gap has torn.
    """

    data: bytes
    reason: SkipReason
    place: WireRange
    touches_gap: bool = False

    @property
    def certain(self) -> bool:
        """They surely were no frame."""
        return not self.touches_gap


@dataclass(frozen=True, slots=True)
class LinkChange:
    """The connection was opened, half-closed, closed or reset."""

    event: WireEvent


@dataclass(frozen=True, slots=True)
class CaptureGap:
    """Bytes passed unseen, or may have: nothing that depends on them can be judged."""

    event: WireEvent


@dataclass(frozen=True, slots=True)
class Injected:
    """A fault was put on the link on purpose: the other side did not get what was sent, as sent."""

    event: WireEvent


class Ending(Enum):
    """How an exchange came to its end."""

    OPEN = "open"
    ANSWERED = "answered"  # everything due has come
    UNANSWERED = "unanswered"  # no first reply in the reply time
    UNFINISHED = "unfinished"  # accepted and ended, but the final result never came
    CUT_OFF = "cut off"  # the link, the capture or its transfer ended first
    HUNG_UP = "hung up"  # the one who was asked ended the link instead of answering
    UNSEEN = "unseen"  # a gap, or more requests than are followed, may hide the answer


@dataclass(eq=False, slots=True)
class Exchange:
    """A request and all that answered it.

    Attributes:
        request: The request.
        command: Its row of the table; None for an undefined opcode.
        name: The command's name, or the undefined opcode.
        reply: The first reply; for a list in parts, the first part.
        result: The final result of a two-stage command.
        parts: All messages of a program list up to this exchange.
        malformed: Bytes that took the place of the reply or the result but are no frame.
        ending: How it ended.
        logged_in: Whether the connection had logged in when it asked; None where the capture
            does not show.
        login_sent_before: Whether a login had been sent before it on its connection.
        refused_login: The reply that had refused the last login, where none had succeeded.
        certain: No gap could have touched it.
        during: The two-stage commands that were executing when this was asked and, where it was
            answered, still were then. Of a two-stage command: as they stood when it was accepted.
        unsettled: That is not sure, or something changed between the two.
        state_version: The scene's when it was asked.
        doubled: A request of the same opcode was unanswered when this one was sent.
        pipelined: A request of any opcode was, in an earlier segment, and still had time for its
            answer.
        later_answered: While it was unanswered a later request was answered.
        overdue: So it was, and its own answer came after the reply time.
        stray: A reply that belonged to no request, and came while this one was unanswered.
        idle: For a two-stage command: the first status 00 that came while it executed.
        stop_asked: An emergency stop was asked for while it executed, or its client hung up.
        interrupted_by: This stop as it stood when it was accepted; for a jog also the next jog.
        after_stop: Its final result came after the stop's.
        transfer: The file transfer that it begins or belongs to.
        transfer_before: For a chunk outside a transfer: the last one of its kind on this
            connection, refused ones included.
        late: It is a chunk after a silence in which its transfer may have been given up (A-5-13).
        chunk: For a chunk: the structure as its transfer's byte order reads it.
        expected_position: For a chunk: where the chunks before it had got to.
    """

    request: FrameSeen
    command: Command | None
    name: str = field(init=False)  # kept, for every rule asks for it
    reply: FrameSeen | None = None
    result: FrameSeen | None = None
    parts: list[FrameSeen] = field(default_factory=list)
    malformed: InvalidBytes | None = None
    ending: Ending = Ending.OPEN
    logged_in: bool | None = None
    login_sent_before: bool = False
    refused_login: FrameSeen | None = None
    certain: bool = True
    during: tuple["Exchange", ...] = ()
    unsettled: bool = False
    state_version: int = 0
    doubled: bool = False
    pipelined: bool = False
    later_answered: bool = False
    overdue: bool = False
    stray: FrameSeen | None = None
    idle: FrameSeen | None = None
    stop_asked: bool = False
    interrupted_by: "Exchange | None" = None
    after_stop: bool = False
    transfer: "Transfer | None" = None
    transfer_before: "Transfer | None" = None
    late: bool = False
    chunk: Chunk | None = None
    expected_position: int = 0

    def __post_init__(self) -> None:
        self.name = self.request.name

    @property
    def asked(self) -> Any:
        """The decoded value of the request."""
        return self.request.value

    @property
    def answer(self) -> Any:
        """The decoded value of the first reply."""
        return self.reply.value if self.reply else None

    @property
    def accepted(self) -> bool | None:
        """Whether the first reply says yes; None where there is none or it says neither."""
        answer = self.answer
        if isinstance(answer, Acceptance):
            return answer.accepted
        return answer if isinstance(answer, bool) else None

    @property
    def outcome(self) -> Outcome | None:
        """What the final result says."""
        value = self.result.value if self.result else None
        return value if isinstance(value, Outcome) else None

    @property
    def error_signal(self) -> bool:
        """Of a chunk: whether its length is 0, or it has no data; the sender gives up (L787)."""
        return not self.request.frame.data or (self.chunk is not None and not self.chunk.length)

    @property
    def latency_ns(self) -> int | None:
        """From the request's last byte to the reply's first."""
        return self.reply.begun_ns - self.request.place.time_ns if self.reply else None

    @property
    def duration_ns(self) -> int | None:
        """From the first reply to the final result: how long it executed."""
        if not self.reply or not self.result:
            return None
        return self.result.begun_ns - self.reply.place.time_ns

    @property
    def time_ns(self) -> int:
        """When it was asked."""
        return self.request.place.time_ns

    @property
    def frames(self) -> tuple[FrameSeen, ...]:
        """All its frames, in order."""
        seen = [self.request, *self.parts] if self.parts else [self.request, self.reply]
        return tuple(f for f in (*seen, self.result) if f)


@dataclass(eq=False, slots=True)
class Transfer:
    """One file on its way: an upload (0x50, 0x52) or a download (0x54, 0x56).

    Attributes:
        upload: Whether it goes to the controller.
        name: The file's name, as sent.
        opening: The exchange that named it; None where the capture came too late for it.
        size_bytes: fileSize of its first chunk, -1 before that.
        order: The byte order that its sender's chunks prove: "little", "big", or "" where none did.
        chunks: How many were sent.
        content: The file from its start, as far as acknowledged chunks follow each other;
            cut at the limit that the dialogue was given.
        received_bytes: How many bytes that is, also beyond the limit.
        whole_content: Whether `content` holds all of `received_bytes`.
        resumed: Its sender went on after a chunk had been refused (A-5-14).
        overanswered: An answer was sent that no chunk awaited: the next may go on for it.
        differs_at: For a download of what is known to be stored: the first byte that came
            otherwise, -1 where none did.
        differs_in: The chunk that brought it.
        state: How it ended.
        reason: Why it failed, or why it is not known.
        certain: No gap could have touched it.
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
    resumed: bool = False
    extra_reply_seen: bool = False
    differs_at: int = -1
    differs_in: FrameSeen | None = None
    state: TransferState = TransferState.ACTIVE
    reason: str = ""
    ended_ns: int = 0
    certain: bool = True


@dataclass(frozen=True, slots=True)
class UnsolicitedReply:
    """A reply or a final result that answers nothing that is open.

    Attributes:
        seen: The frame.
        after: The last answered exchange of that command on the connection, where there was one.
        waiting: Requests that were unanswered at that time.
        certain: No gap could hide what it answers.
        late: It may answer a request that was given up, or that could not be read.
        elsewhere: A final result whose command another connection had asked for (A-2-9).
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
