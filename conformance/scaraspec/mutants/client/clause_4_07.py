"""Mutants of clauses 4.7 and 4.8: version and status."""

from scaraspec.client.core import ClientCore, Event
from scaraspec.client.results import Status
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.frames import ignores_after
from scaraspec.mutants.operators.client.messages import reply_data, request_data, returned
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.errors import lookup
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import Frame

# 4.7


def _as_numbers(data: bytes) -> bytes:
    numbers = data.split(b".")
    if not all(number.isdigit() for number in numbers):
        return data
    return b".".join(b"%d" % int(number) for number in numbers)


row(
    "asks-for-the-version-of-something",
    "4.7/1",
    "The request for the version contains a space.",
    request_data("get_version", lambda data: data + b" "),
)
row(
    "five-characters",
    "4.7/5",
    "Only five characters of the version are returned.",
    reply_data("get_version", lambda data: data[:5]),
)
row(
    "three-numbers",
    "4.7/5",
    "The numbers of the version are returned without leading zeros.",
    reply_data("get_version", _as_numbers),
    subtle=True,
)
row(
    "sixty-four-characters",
    "4.7/5",
    "Only 64 characters of the version are returned.",
    reply_data("get_version", lambda data: data[:64]),
    subtle=True,
)


@mutant("end-of-the-last-version", "4.7/5", "T/9", subtle=True)
class ReusesVersionBuffer(ClientCore):
    """A version that is shorter than the previous one ends like the previous one."""

    _buffer = b""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if not frame.tagged and frame.opcode == BY_NAME["get_version"].opcode:
            self._buffer = frame.data + self._buffer[len(frame.data) :]
            frame = frame._replace(data=self._buffer)
        return super()._dispatch(frame, now_s)


# 4.8


def _is_unknown_status(frame: Frame) -> bool:
    return frame.opcode == BY_NAME["get_status"].opcode and lookup(show(frame.data)) is None


def _digits(status: Status) -> Status:
    return status._replace(code="".join(filter(str.isdigit, status.code)).zfill(2))


def _single_fault(data: bytes) -> bytes:
    code = lookup(show(data))
    return b"" if code and len(code.joints) > 1 else data


row(
    "asks-for-the-status-with-data",
    "4.8/1",
    "The request for the status contains a NUL.",
    request_data("get_status", lambda data: data + b"\0"),
)
row(
    "wants-capitals",
    "4.8/11",
    "A status code in lower case is returned as idle.",
    reply_data("get_status", lambda data: b"00" if data != data.upper() else data),
    subtle=True,
)
row(
    "reads-codes-as-numbers",
    "4.8/11 T/9",
    "Only the decimal digits of a status code are returned.",
    returned("get_status", _digits),
)
row(
    "goes-deaf-at-unknown-codes",
    "4.8/11",
    "After a status code that is not in table 8-1, all received bytes are ignored.",
    ignores_after(_is_unknown_status),
    subtle=True,
)
row(
    "unknown-is-idle",
    "4.8/11",
    "A status code that is not in table 8-1 is returned as idle.",
    reply_data("get_status", lambda data: data if lookup(show(data)) else b"00"),
    subtle=True,
)
row(
    "knows-single-faults-only",
    "4.8/11",
    "A status code for faults of several motors cannot be read.",
    reply_data("get_status", _single_fault),
    subtle=True,
)
