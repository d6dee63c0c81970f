"""Line: one connection to the subject, on which the suite plays the client.

Requests are made from the command table, or are whatever bytes a case wants. What comes is framed,
timed and kept until somebody asks for it, so that nothing that a subject sends goes unseen. Which
answer is right is not known here.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from scaraspec.judgement.happenings import FrameSeen, Undecodable
from scaraspec.judgement.stream import Stream
from scaraspec.judgement.wire import Kind, WireEvent
from scaraspec.links.link import Arrival, Ending, Link, LinkError
from scaraspec.protocol.commands import BY_NAME, Command
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.suite.expect import NoAnswer, Unmet

if TYPE_CHECKING:
    from scaraspec.suite.as_client.subject import Subject

_SLICE_S: Final = 0.02  # how long one line is listened to while others may have something to say
_APART_S: Final = 0.05
_INSTANT_S: Final = 0.005
_NS: Final = 1_000_000_000
_FLOOD_BYTES: Final = 2**16
_FLOOD_RATIO: Final = 64
"""A subject that sends more than this, and so many times what it was sent last, sends for ever."""


class Answer(NamedTuple):
    """What a subject sent.

    Attributes:
        seen: The frame, and where and when it was.
        value: Its decoded value; None where it has none.
    """

    seen: FrameSeen
    value: Any

    @property
    def frame(self) -> Frame:
        """The frame."""
        return self.seen.frame

    @property
    def time_s(self) -> float:
        """When its first byte came, in seconds since the Unix epoch."""
        return self.seen.begun_ns / _NS

    @property
    def accepted(self) -> bool | None:
        """Whether it says yes; None where it says neither."""
        if isinstance(self.value, Acceptance):
            return self.value.accepted
        return self.value if isinstance(self.value, bool) else None

    @property
    def code(self) -> str | None:
        """The code of table 8-1 that it bears, if any."""
        return self.value.code if isinstance(self.value, Acceptance | Outcome) else None

    @property
    def done(self) -> bool | None:
        """Of a final result: whether it says done."""
        return self.value.done if isinstance(self.value, Outcome) else None

    def __str__(self) -> str:
        return f"{self.frame}"


class Line:
    """One connection; made by `Subject.open`.

    Attributes:
        name: Its name in the recording.
        heard: Frames that came and that nobody has taken yet, in order.
        noise: What came and was no frame.
        ending: How the subject ended it; None while it is open.
    """

    def __init__(self, name: str, link: Link, subject: "Subject", *, judged: bool) -> None:
        self.name = name
        self.heard: list[FrameSeen] = []
        self.noise: list[Undecodable] = []
        self.ending: Ending | None = None
        self.closed = False
        self._due_bytes = _FLOOD_BYTES
        self._link, self._subject, self._judged = link, subject, judged
        self._streams = {direction: Stream(name, direction) for direction in Direction}
        self._offsets_bytes = dict.fromkeys(Direction, 0)
        self._event(A2C, Kind.OPENED, subject.now_ns)

    # ------------------------------------------------------------------ sending

    def send_bytes(self, data: bytes) -> None:
        """Send bytes as they are.

        Raises:
            NoAnswer: The subject has ended the connection.
        """
        if not data:
            return
        self.pump()  # what has come so far came before this
        try:
            time_ns = self._link.send(data)
        except LinkError as error:
            self.pump()
            raise NoAnswer(f"the subject does not take what is sent: {error}") from None
        self._due_bytes = _FLOOD_BYTES + _FLOOD_RATIO * len(data)
        self._event(A2C, Kind.BYTES, time_ns, data)

    def send_frame(self, frame: Frame) -> None:
        """Send one frame."""
        self.send_bytes(frame.encode())

    def send(self, name: str, value: Any = None, *, data: bytes | None = None) -> Command:
        """Send a request of the table; `data` takes the place of its encoded value.

        Returns:
            Its row.
        """
        frame = self.request(name, value, data=data)
        self.send_frame(frame)
        return BY_NAME[name]

    def request(self, name: str, value: Any = None, *, data: bytes | None = None) -> Frame:
        """The frame of a request, in the subject's dialect."""
        command, dialect = BY_NAME[name], self._subject.dialect
        payload = command.request.encode(value, dialect) if data is None else data
        opcode = command.opcode
        if command.also is not None and dialect["op_get_default"] == "0x13":
            opcode = command.also
        return Frame(A2C, opcode, payload)

    # ------------------------------------------------------------------ asking

    def ask(
        self,
        name: str,
        value: Any = None,
        *,
        data: bytes | None = None,
        within_s: float | None = None,
    ) -> Answer:
        """Send a request and wait for its first reply.

        Raises:
            NoAnswer: None came in `within_s`, by default the subject's reply time.
        """
        self.send(name, value, data=data)
        return self.reply(name, within_s=within_s)

    def reply(self, name: str, *, within_s: float | None = None) -> Answer:
        """Wait for a first reply, or for a chunk of a download.

        Raises:
            NoAnswer: None came.
        """
        command = BY_NAME[name]
        opcodes = {command.opcode, command.also, command.reply_also} - {None}
        return self._await(
            lambda seen: not seen.frame.tagged and seen.frame.opcode in opcodes,
            self._subject.reply_s if within_s is None else within_s,
            f"{name} was not answered",
        )

    def result(self, name: str, *, within_s: float | None = None) -> Answer:
        """Wait for the final result of a two-stage command.

        Raises:
            NoAnswer: None came in `within_s`, by default what the longest motion may take.
        """
        opcode = BY_NAME[name].opcode
        return self._await(
            lambda seen: seen.frame.tagged and seen.frame.opcode == opcode,
            self._subject.longest_s if within_s is None else within_s,
            f"no final result of {name} came",
        )

    def no_result(self, name: str, *, for_s: float) -> None:
        """Fail the subject if a final result of this command comes within this time.

        Raises:
            Unmet: One came.
        """
        self.wait(for_s)
        opcode = BY_NAME[name].opcode
        for seen in self.heard:
            if seen.frame.tagged and seen.frame.opcode == opcode:
                message = f"a final result of {name} came that must not come"
                raise Unmet(message, expected="none", observed=f"{seen.frame}")

    def answer_chunk(self, *, accepted: bool) -> None:
        """Answer a chunk of a download."""
        data = BY_NAME["download_chunk"].reply.encode(accepted, self._subject.dialect)
        self.send_frame(Frame(A2C, BY_NAME["download_chunk"].opcode, data))

    def apart(self) -> None:
        """Let what was sent arrive alone, where no reply says that it did.

        Not every subject takes two frames that arrive together (A-3-14).
        """
        self.wait(_APART_S if self._subject.dialect["pipelining"] == "one" else _INSTANT_S)

    def fence(self) -> list[FrameSeen]:
        """Ask for the status, and take everything that came before its reply.

        Replies come in the order of their requests (3/14), so what has not come by then is not
        coming: silence is shown without waiting.

        Raises:
            NoAnswer: Not even this was answered.
        """
        if self._subject.dialect["pipelining"] == "one":
            self.apart()
        self.send("get_status")
        before = list(self.heard)
        self.heard.clear()
        opcode = BY_NAME["get_status"].opcode
        deadline_s = self._link.now_s + self._subject.reply_s
        while True:
            while self.heard:
                seen = self.heard.pop(0)
                if seen.frame.opcode == opcode and not seen.frame.tagged:
                    return before
                before.append(seen)
            if not self._more(deadline_s):
                self.heard[:0] = before
                raise self._no_answer("get_status was not answered")

    def wait(self, for_s: float) -> None:
        """Let time pass, listening; it ends early only with the connection."""
        deadline_s = self._link.now_s + for_s
        while self._more(deadline_s) and self._link.now_s <= deadline_s:
            pass

    def ends(self, *, within_s: float) -> Ending | None:
        """Wait for the subject to end the connection; None if it does not."""
        self.wait(within_s)
        return self.ending

    def _await(self, wanted: Callable[[FrameSeen], bool], within_s: float, message: str) -> Answer:
        deadline_s = self._link.now_s + within_s
        while True:
            for seen in self.heard:
                if wanted(seen):
                    self.heard.remove(seen)
                    return Answer(seen, seen.value)
            if not self._more(deadline_s) or self._link.now_s > deadline_s:
                raise self._no_answer(f"{message} in {within_s:g} s")

    def _no_answer(self, message: str) -> NoAnswer:
        came = [f"{seen.frame}" for seen in self.heard]
        came += [f"no frame: {show(noise.data)}" for noise in self.noise]
        if self.ending:
            came.append(f"the connection was {self.ending.value}")
        return NoAnswer(message, expected="an answer", observed="; ".join(came) or "silence")

    # ------------------------------------------------------------------ listening

    def pump(self) -> None:
        """Take what is there already, without waiting."""
        while self._receive(self._link.now_s):
            pass

    def _more(self, deadline_s: float) -> bool:
        """Wait for anything to come; False once the time is up or the connection has ended."""
        while True:
            if self._ended:
                return False
            alone = self._subject.pump_others(self)
            until_s = deadline_s if alone else min(deadline_s, self._link.now_s + _SLICE_S)
            if self._receive(until_s):
                return True
            if self._link.now_s >= deadline_s:
                return False

    @property
    def _ended(self) -> bool:
        return self.closed or self.ending is not None

    def _receive(self, deadline_s: float) -> bool:
        """Take one arrival; whether there was one."""
        if self._ended:
            return False
        try:
            arrival = self._link.receive(deadline_s)
        except LinkError:
            arrival = Arrival(self._subject.now_ns, Ending.RESET)
        if arrival is None:
            return False
        if isinstance(arrival.what, Ending):
            self.ending = arrival.what
            kind = Kind.RESET if arrival.what is Ending.RESET else Kind.CLOSED
            self._take(C2A, self._streams[C2A].finish())
            self._event(C2A, kind, arrival.time_ns)
        else:
            self._event(C2A, Kind.BYTES, arrival.time_ns, arrival.what)
            self._check_flood(len(arrival.what))
        return True

    def _check_flood(self, size_bytes: int) -> None:
        self._due_bytes -= size_bytes
        if self._due_bytes < 0:
            self._over(self._link.reset, Kind.RESET)
            message = "the subject goes on sending what nobody has asked for"
            raise Unmet(message, expected="silence", observed="a flood", requirement="3/32")

    def _event(self, direction: Direction, kind: Kind, time_ns: int, data: bytes = b"") -> None:
        offset_bytes = self._offsets_bytes[direction]
        event = WireEvent(time_ns, self.name, direction, kind, data, offset_bytes)
        self._offsets_bytes[direction] += len(data)
        self._subject.observer.event(event, judged=self._judged)
        if data:
            self._take(direction.opposite, self._streams[direction.opposite].settle())
            self._take(direction, self._streams[direction].feed(event))

    def _take(self, direction: Direction, found: "Iterator[FrameSeen | Undecodable]") -> None:
        for item in found:
            self._subject.observer.frame(item)
            if direction is C2A and isinstance(item, FrameSeen):
                self.heard.append(item)
            elif direction is C2A and isinstance(item, Undecodable):
                self.noise.append(item)

    # ------------------------------------------------------------------ ending

    def half_close(self) -> None:
        """Send no more, but listen on.

        Raises:
            Undecided: This carrier cannot.
        """
        self._subject.sure(self._link.half_close)
        self._event(A2C, Kind.HALF_CLOSED, self._subject.now_ns)

    def close(self) -> None:
        """End the connection in order."""
        self._end(self._link.close, Kind.CLOSED)

    def reset(self) -> None:
        """Cut the connection off."""
        self._end(self._link.reset, Kind.RESET)

    def _end(self, end: Callable[[], None], kind: Kind) -> None:
        with suppress(Unmet):  # a flood ends it by itself
            self.pump()
        if not self.closed:
            self._over(end, kind)

    def _over(self, end: Callable[[], None], kind: Kind) -> None:
        self.closed = True
        end()
        if self.ending is None:
            self._event(A2C, kind, self._subject.now_ns)
