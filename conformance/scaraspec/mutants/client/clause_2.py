"""Mutants of clause 2: the connection, the first request, and frames in segments."""

from collections.abc import Callable

from scaraspec.client.aio import AsyncClient
from scaraspec.client.base import LINK_LOST_REASONS
from scaraspec.client.core import ClientCore, Event
from scaraspec.client.errors import ClientError, LinkLost
from scaraspec.client.pending_operation import Login, PendingOperation
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.frames import received_items
from scaraspec.mutants.operators.client.process_memory import memory
from scaraspec.protocol.commands import BY_NAME, BY_OPCODE
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, Framer, StreamItem
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.transports.link import Ending

# The connection


@mutant("stays-connected-when-cut", "2/1")
class SkipsReconnectAfterReset(AsyncClient):
    """After its connection was reset, the client does not connect the next time."""

    async def connect(self) -> None:
        if not memory().pop("cut", False):
            await super().connect()

    def _connection_lost(self, reason: str) -> None:
        if reason == LINK_LOST_REASONS[Ending.RESET]:
            memory()["cut"] = True
        super()._connection_lost(reason)


@mutant("rests-after-vain-logins", "2/1", subtle=True)
class SkipsConnectAfterFailure(AsyncClient):
    """After a failed connection or login, the client does not connect the next time."""

    async def connect(self) -> None:
        if memory().pop("failed", False):
            raise LinkLost("the last login failed")
        try:
            await super().connect()
        except ClientError:
            memory()["failed"] = True
            raise


@mutant("dials-the-next-port", "2/3")
class ConnectsToNextPort(AsyncClient):
    """The client connects to port 8878 in place of 8877."""

    def __init__(self, url: str, **values: object) -> None:
        super().__init__(url.replace(f":{DEFAULT_PORT}", f":{DEFAULT_PORT + 1}"), **values)  # type: ignore[arg-type] # handed on


# The first request


@mutant("asks-for-the-version-first", "2/10")
class RequestsVersionFirst(ClientCore):
    """The client requests the version before the login."""

    def begin(self, operation: PendingOperation, now_s: float) -> None:
        if isinstance(operation, Login):
            self._send([Frame(A2C, BY_NAME["get_version"].opcode)])
        super().begin(operation, now_s)


@mutant("asks-for-the-status-when-it-comes-back", "2/10", subtle=True)
class RequestsStatusAfterReconnect(AsyncClient):
    """From its second connection on, the client requests the status before the login."""

    async def _login(self) -> None:
        if memory().setdefault("met", False) and self._transport is not None:
            self._transport.write(Frame(A2C, BY_NAME["get_status"].opcode).encode())
        memory()["met"] = True
        await super()._login()


def _logs_in(times: int) -> type[AsyncClient]:
    """Only the first connections log in; on later ones, all requests are sent without a login."""

    class Unlocked(ClientCore):
        def begin(self, operation: PendingOperation, now_s: float) -> None:
            self.logged_in = True
            super().begin(operation, now_s)

    class LogsIn(AsyncClient):
        core = Unlocked

        async def _login(self) -> None:
            memory()["logins"] = memory().get("logins", 0) + 1
            if memory()["logins"] <= times:
                await super()._login()

    return LogsIn


row(
    "connects-without-a-login",
    "2/10",
    "The client reports a connection as done without a login.",
    _logs_in(0),
)
row(
    "logs-in-three-times",
    "2/10",
    "From its fourth connection on, the client reports a connection as done without a login.",
    _logs_in(3),
    subtle=True,
)


# Frames in several segments


def _drop_partial(condition: Callable[[int], bool]) -> type[ClientCore]:
    """A partial frame is dropped at the end of a segment if its size satisfies the condition."""

    class DropPartial(ClientCore):
        def feed(self, data: bytes, now_s: float) -> list[Event]:
            events = super().feed(data, now_s)
            if condition(self._framer.buffered_bytes):
                events += self._process_items(self._framer.finish(), now_s)
            return events

    return DropPartial


def _lost_in_parts(command: str) -> type[ClientCore]:
    """A frame of a command is lost if it arrives in several segments."""

    class LostInParts(ClientCore):
        begun = False

        def feed(self, data: bytes, now_s: float) -> list[Event]:
            self.begun = self._framer.buffered_bytes > 0
            return super().feed(data, now_s)

        def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
            lost = self.begun and frame.opcode == BY_NAME[command].opcode
            return [] if lost else super()._dispatch(frame, now_s)

    return LostInParts


row(
    "takes-segments-for-frames",
    "2/5",
    "A frame that is incomplete at the end of a segment is dropped.",
    _drop_partial(lambda _: True),
)
row(
    "needs-the-head-at-once",
    "2/5",
    "A frame of which only one or two bytes have arrived is dropped.",
    _drop_partial(lambda size_bytes: size_bytes in (1, 2)),
    subtle=True,
)


@mutant("loses-last-bytes-alone", "2/5", subtle=True)
class LosesSingleEndByte(ClientCore):
    """The end byte of a frame is lost if it arrives alone in a segment."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        alone = data == b"\xaa" and self._framer.buffered_bytes > 0
        return [] if alone else super().feed(data, now_s)


@mutant("impatient-within-frames", "2/5", subtle=True)
class GivesUpPartialFrames(ClientCore):
    """A frame that pauses for half a second is dropped."""

    @property
    def _partial_until_s(self) -> float | None:
        return self._last_received_s + 0.5 if self._framer.buffered_bytes else None


row(
    "loses-chunks-in-pieces",
    "2/5",
    "A chunk that arrives in several segments is lost.",
    _lost_in_parts("download_chunk"),
    subtle=True,
)
row(
    "loses-logins-in-pieces",
    "2/5",
    "The reply to the login is lost if it arrives in several segments.",
    _lost_in_parts("login"),
    subtle=True,
)


@mutant("forgets-pieces-when-it-asks", "2/5", subtle=True)
class DropsPartialFrameAtRequest(ClientCore):
    """An incomplete frame is dropped when another request is sent."""

    def begin(self, operation: PendingOperation, now_s: float) -> None:
        self._framer = Framer(C2A)
        super().begin(operation, now_s)


# Several frames in a segment


def _accepts(item: StreamItem) -> bool:
    if not isinstance(item, Frame) or item.tagged or item.data != b"1":
        return False
    command = BY_OPCODE.get(item.opcode)
    return command is not None and command.two_stage


def _up_to(command: str) -> type[ClientCore]:
    """Frames after a frame of one command in the same segment are dropped."""

    def change(items: list[StreamItem]) -> list[StreamItem]:
        opcode = BY_NAME[command].opcode
        for count, item in enumerate(items, 1):
            if isinstance(item, Frame) and item.opcode == opcode and not item.tagged:
                return items[:count]
        return items

    return received_items(change)


row(
    "serves-the-first-of-each-segment",
    "2/6",
    "Only the first frame of a segment is processed.",
    received_items(lambda items: items[:1]),
)
row(
    "serves-four-of-each-segment",
    "2/6",
    "Only the first four frames of a segment are processed.",
    received_items(lambda items: items[:4]),
    subtle=True,
)
row(
    "serves-the-last-of-each-segment",
    "2/6",
    "Only the last frame of a segment is processed.",
    received_items(lambda items: items[-1:]),
    subtle=True,
)
row(
    "accepts-at-the-beginning",
    "2/6",
    "The acceptance of a two-stage command is ignored after another frame in the same segment.",
    received_items(lambda items: items[:1] + [item for item in items[1:] if not _accepts(item)]),
    subtle=True,
)
row(
    "drops-what-is-behind-chunks",
    "2/6",
    "Frames after a chunk in the same segment are dropped.",
    _up_to("download_chunk"),
    subtle=True,
)
row(
    "drops-what-is-behind-answers-to-chunks",
    "2/6",
    "Frames after the reply to a chunk in the same segment are dropped.",
    _up_to("upload_chunk"),
    subtle=True,
)
row(
    "drops-what-is-behind-lists",
    "2/6",
    "Frames after a part of the program list in the same segment are dropped.",
    _up_to("list_programs"),
    subtle=True,
)
