"""Operators that change one message of the reference client, or the value that it returns.

`command` is the name of a row of the command table. A change is a function of the data, or a
table of data and what is sent or read in its place.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore, Event
from scaraspec.client.pending_operation import PendingOperation, TwoStage
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame

Change = Callable[[bytes], bytes] | Mapping[bytes, bytes]


def request_data(command: str, change: Change) -> type[ClientCore]:
    """The data of requests of one command are changed before they are sent."""

    class RequestData(ClientCore):
        def _send(self, frames: Iterable[Frame]) -> None:
            super()._send(_changed(frame, command, change) for frame in frames)

    return RequestData


def request_fields(command: str, change: Callable[[list[bytes]], list[bytes]]) -> type[ClientCore]:
    """The fields of requests of one command are changed before they are sent."""
    return request_data(command, lambda data: b"|".join(change(data.split(b"|"))))


def reply_data(command: str, change: Change) -> type[ClientCore]:
    """The data of first replies to one command are changed before they are decoded."""

    class ReplyData(ClientCore):
        def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
            return super()._dispatch(_changed(frame, command, change), now_s)

    return ReplyData


def result_data(change: Change) -> type[ClientCore]:
    """The data of all final results are changed before they are decoded."""

    class ResultData(ClientCore):
        def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
            if frame.tagged:
                frame = frame._replace(data=_change_data(change, frame.data))
            return super()._dispatch(frame, now_s)

    return ResultData


def returned(method: str, change: Callable[[Any], Any]) -> type[AsyncClient]:
    """A method of the client returns a changed value."""

    async def call(client: AsyncClient, *args: Any) -> Any:
        return change(await getattr(super(changed, client), method)(*args))

    changed: type[AsyncClient] = type("Returned", (AsyncClient,), {method: call})
    return changed


def _changed(frame: Frame, command: str, change: Change) -> Frame:
    if frame.tagged or frame.opcode != BY_NAME[command].opcode:
        return frame
    return frame._replace(data=_change_data(change, frame.data))


def _change_data(change: Change, data: bytes) -> bytes:
    return change.get(data, data) if isinstance(change, Mapping) else change(data)


class ReplacesRequests(ClientCore, ABC):
    """One request is not what it should be."""

    name: ClassVar[str]
    """The command in question."""

    @abstractmethod
    def replaced(self, frame: Frame) -> Frame:
        """What is sent in place of the request."""

    def _send(self, frames: Iterable[Frame]) -> None:
        super()._send(map(self._altered, frames))

    def _altered(self, frame: Frame) -> Frame:
        return self.replaced(frame) if frame.opcode == BY_NAME[self.name].opcode else frame


class AltersRequests(ReplacesRequests, ABC):
    """The data of one request are not what they should be."""

    @abstractmethod
    def altered(self, data: bytes) -> bytes:
        """What is sent in place of the data."""

    def replaced(self, frame: Frame) -> Frame:
        """The request with those."""
        return frame._replace(data=self.altered(frame.data))


class AltersFields(AltersRequests, ABC):
    """The fields of one request are not what they should be."""

    @abstractmethod
    def fields(self, fields: list[bytes]) -> list[bytes]:
        """What is sent in their place."""

    def altered(self, data: bytes) -> bytes:
        """Join them."""
        return b"|".join(self.fields(data.split(b"|")))


class SendsUnchecked(AltersFields, ABC):
    """A value that is not to be sent goes out all the same."""

    place: ClassVar[int] = 0
    """Which of the fields."""
    _unchecked: float | None = None

    @abstractmethod
    def passes(self, value: float) -> bool:
        """Whether this one does."""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        """Show the encoder a 1 in its place."""
        self._unchecked = None
        if name == self.name:
            fields = list(value) if isinstance(value, tuple) else [value]
            if self.passes(fields[self.place]):
                self._unchecked, fields[self.place] = fields[self.place], 1
                value = type(value)(*fields)
        return super().command(name, value)

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Put it back."""
        if self._unchecked is not None:
            fields[self.place] = f"{self._unchecked}".encode()
        return fields


class AltersReplies(ClientCore, ABC):
    """The data of one reply are read otherwise than they came."""

    name: ClassVar[str]
    """The command in question."""

    @abstractmethod
    def altered(self, data: bytes) -> bytes:
        """What is read in place of the data."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if not frame.tagged and frame.opcode == BY_NAME[self.name].opcode:
            frame = frame._replace(data=self.altered(frame.data))
        return super()._dispatch(frame, now_s)


class AltersResults(ClientCore, ABC):
    """The data of final results are read otherwise than they came."""

    @abstractmethod
    def altered(self, data: bytes) -> bytes:
        """What is read in place of the data."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.tagged:
            frame = frame._replace(data=self.altered(frame.data))
        return super()._dispatch(frame, now_s)


class OtherTwoStage(ClientCore):
    """Two-stage commands are carried out otherwise."""

    shape: ClassVar[type[TwoStage]]
    """How."""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        """Take the other way."""
        if not BY_NAME[name].two_stage:
            return super().command(name, value)
        return self.shape(BY_NAME[name], value, self.dialect)


class TakesLossForSuccess(ClientCore, ABC):
    """A link that is lost before a command was answered is taken for its success."""

    name: ClassVar[str]
    """The command in question."""

    def connection_lost(self, reason: str, now_s: float) -> list[Event]:
        """Take it for that."""
        events: list[Event] = []
        for operation in tuple(self._open):
            if operation.command.name == self.name:
                operation.settle(None)
                events += self._after_step(operation, now_s)
        return events + super().connection_lost(reason, now_s)
