"""Operators that change what the reference client sends or receives: bytes, items or frames."""

from collections.abc import Callable, Iterable

from scaraspec.client.core import ClientCore, Event
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame, StreamItem


def received(change: Callable[[Frame], Frame | None]) -> type[ClientCore]:
    """Each received frame is changed before it is processed; None drops the frame."""
    return received_while(lambda frame, _: change(frame))


def received_while(
    change: Callable[[Frame, list[PendingOperation]], Frame | None],
) -> type[ClientCore]:
    """Received frames are changed, depending on the open operations; None drops the frame."""

    class Received(ClientCore):
        def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
            changed = change(frame, self._open)
            return [] if changed is None else super()._dispatch(changed, now_s)

    return Received


def received_bytes(change: Callable[[bytes], bytes]) -> type[ClientCore]:
    """The bytes of each received segment are changed."""

    class ReceivedBytes(ClientCore):
        def feed(self, data: bytes, now_s: float) -> list[Event]:
            return super().feed(change(data), now_s)

    return ReceivedBytes


def received_items(
    change: Callable[[list[StreamItem]], Iterable[StreamItem]],
) -> type[ClientCore]:
    """The frames and skipped bytes that are found in one segment are changed."""

    class ReceivedItems(ClientCore):
        def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
            return super()._process_items(change(list(found)), now_s)

    return ReceivedItems


def ignores_after(condition: Callable[[Frame], bool]) -> type[ClientCore]:
    """After a frame that satisfies the condition, all received bytes are ignored."""

    class IgnoresAfter(ClientCore):
        ignoring = False

        def feed(self, data: bytes, now_s: float) -> list[Event]:
            return [] if self.ignoring else super().feed(data, now_s)

        def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
            self.ignoring = self.ignoring or condition(frame)
            return super()._dispatch(frame, now_s)

    return IgnoresAfter


def sent(change: Callable[[Frame], Iterable[Frame]]) -> type[ClientCore]:
    """Each frame is replaced by the frames that `change` returns."""

    class Sent(ClientCore):
        def _send(self, frames: Iterable[Frame]) -> None:
            super()._send(each for frame in frames for each in change(frame))

    return Sent


def frame_bytes(command: str, change: Callable[[bytes], bytes]) -> type[ClientCore]:
    """The encoded frames of requests of one command are changed."""

    class FrameBytes(ClientCore):
        def _send(self, frames: Iterable[Frame]) -> None:
            for frame in frames:
                data = frame.encode()
                meant = frame.opcode == BY_NAME[command].opcode
                self._outbox += change(data) if meant else data

    return FrameBytes
