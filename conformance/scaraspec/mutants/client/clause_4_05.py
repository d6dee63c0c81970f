"""Mutants of clauses 4.5 and 4.6: the time."""

from collections.abc import Callable, Iterable
from datetime import datetime

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore
from scaraspec.mutants.client import row
from scaraspec.mutants.operators.client.messages import request_data
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame

# 4.5


def _separated(data: bytes) -> bytes:
    return b"%b-%b-%b %b:%b:%b" % (data[:4], *(data[i : i + 2] for i in range(4, 14, 2)))


def _twelve_hours(data: bytes) -> bytes:
    return data[:8] + b"%02d" % ((int(data[8:10]) + 11) % 12 + 1) + data[10:]


def _raw_time(
    change: Callable[[bytes, str], bytes], valid: Callable[[str], str]
) -> type[AsyncClient]:
    """The data of a request for a valid time are changed, depending on the text of the caller."""

    class RawTimeCore(ClientCore):
        text = ""

        def _send(self, frames: Iterable[Frame]) -> None:
            super()._send(map(self._changed, frames))

        def _changed(self, frame: Frame) -> Frame:
            if frame.opcode != BY_NAME["set_time"].opcode:
                return frame
            return frame._replace(data=change(frame.data, self.text))

    class RawTime(AsyncClient):
        core = RawTimeCore

        async def set_time(self, time: datetime | str) -> None:
            assert isinstance(self._core, RawTimeCore)
            self._core.text = str(time)
            await super().set_time(valid(str(time)))

    return RawTime


row(
    "short-years",
    "4.5/1",
    "The year is sent with two digits.",
    request_data("set_time", lambda data: data[2:]),
)
row(
    "separated-time",
    "4.5/1",
    "The time is sent with separators between its parts.",
    request_data("set_time", _separated),
)
row(
    "unpadded-time",
    "4.5/1",
    "Hours below ten are sent with one digit.",
    request_data("set_time", lambda data: data[:8] + b"%d" % int(data[8:10]) + data[10:]),
    subtle=True,
)
row(
    "twelve-hours",
    "4.5/1 T/10",
    "The hours are sent from 1 to 12.",
    request_data("set_time", _twelve_hours),
    subtle=True,
)
row(
    "december-is-thirteen",
    "4.5/2",
    "December is sent as the month 13.",
    request_data(
        "set_time", lambda data: data[:4] + b"13" + data[6:] if data[4:6] == b"12" else data
    ),
    subtle=True,
)
row(
    "midnight-is-twenty-four",
    "4.5/2",
    "Midnight is sent as the hour 24.",
    request_data(
        "set_time", lambda data: data[:8] + b"24" + data[10:] if data[8:10] == b"00" else data
    ),
    subtle=True,
)
row(
    "sends-any-digits",
    "4.5/2",
    "Any text is sent as a time.",
    _raw_time(lambda _, text: text.encode(), lambda _: "20000101000000"),
)
row(
    "every-year-is-leap",
    "4.5/2",
    "29 February is sent in every year.",
    _raw_time(lambda data, text: text[:4].encode() + data[4:], lambda text: f"2000{text[4:]}"),
    subtle=True,
)

# 4.6

row(
    "asks-with-its-own-time",
    "4.6/1",
    "The request for the time contains a time.",
    request_data("get_time", lambda data: data + b"20141222143000"),
)
