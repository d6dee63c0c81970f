"""Mutants of clause T: separators, quotation marks, digits, numbers and names that are sent."""

import re
import unicodedata
from collections.abc import Callable
from typing import Any, Literal

from scaraspec.client.core import ClientCore
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.client.transfer import Download, Upload
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.messages import (
    request_data,
    request_fields,
    request_over_last,
    sent_raw,
)

# Separators


def _two_bars(data: bytes) -> bytes:
    head, _, tail = data.rpartition(b"|")
    return head + b"||" + tail


def _column(fields: list[bytes]) -> list[bytes]:
    return [f"{fields[0].decode():8}".encode(), *fields[1:]]


row(
    "blanks-for-bars",
    "T/1",
    "The network settings are separated by spaces, as the document prints them.",
    request_data("set_network", lambda data: data.replace(b"|", b" ")),
)
row(
    "commas-for-bars",
    "T/1",
    "The coordinates of the gripper center are separated by commas.",
    request_data("set_gripper_center", lambda data: data.replace(b"|", b",")),
)
row(
    "blanks-around-bars",
    "T/1",
    "A move is sent with spaces around its bars.",
    request_data("set_tool_coordinates", lambda data: data.replace(b"|", b" | ")),
)
row(
    "two-bars",
    "T/1",
    "The last two values of the initial position are separated by two bars.",
    request_data("set_initial_tool_position", _two_bars),
)
row(
    "columns-for-bars",
    "T/1",
    "The old password is padded with spaces to eight characters.",
    request_fields("set_password", _column),
    subtle=True,
)

# Quotation marks and digits


def _as_bytes(fields: list[bytes]) -> list[bytes]:
    return [bytes((int(text),)) for text in fields]


row(
    "quoted-names",
    "T/2",
    "The name of the program to run is sent in quotation marks.",
    request_data("run_program", lambda data: b'"' + data + b'"'),
)
row(
    "curly-quotes",
    "T/2",
    "The time is sent in the curly quotation marks that the document prints.",
    request_data("set_time", lambda data: "“".encode() + data + "”".encode()),
)
row(
    "binary-port",
    "T/3",
    "Port and value of an output are sent as one byte each.",
    request_fields("set_digital_output", _as_bytes),
)
row(
    "packed-time",
    "T/3 4.5/1",
    "The time is sent with two digits in each byte.",
    request_data("set_time", lambda data: bytes.fromhex(data.decode())),
)

# Ends

row(
    "names-end-with-lines",
    "T/4",
    "A line end follows the name of the program to simulate.",
    request_data("simulate_program", lambda data: data + b"\r\n"),
)
row(
    "time-ends-with-blanks",
    "T/4",
    "The time is padded with spaces to sixteen characters.",
    request_data("set_time", lambda data: data.ljust(16)),
)
row(
    "rest-of-the-buffer",
    "T/4",
    "A NUL and other bytes follow the name of the default program.",
    request_data("set_default_program", lambda data: data + b"\0xyz"),
    subtle=True,
)

# Numbers


def _numbers(write: Callable[[float], str]) -> type[ClientCore]:
    """The numbers of the gripper center are written in another way."""
    return request_fields(
        "set_gripper_center", lambda fields: [write(float(text)).encode() for text in fields]
    )


def _with_exponent(number: float) -> str:
    return f"{number}" if 1e-3 <= abs(number) < 1e7 or not number else f"{number:e}"


row(
    "exponents",
    "T/5",
    "Large and small numbers are sent with an exponent.",
    _numbers(_with_exponent),
    subtle=True,
)
row(
    "commas-for-points",
    "T/5",
    "The numbers of the initial position have a decimal comma.",
    request_data("set_initial_tool_position", lambda data: data.replace(b".", b",")),
)
row(
    "empty-for-zero",
    "T/5",
    "A zero is sent as an empty field.",
    _numbers(lambda number: f"{number:.3f}" if number else ""),
)
row(
    "no-zero-ahead-of-the-point",
    "T/5",
    "Numbers below one are sent without the zero before the decimal point.",
    _numbers(lambda number: re.sub(r"\b0\.", ".", f"{number:.3f}")),
    subtle=True,
)

# Bars in texts


def _bars(*commands: str) -> type[ClientCore]:
    """A text with a bar is sent."""
    return sent_raw(
        commands,
        raw=lambda text: text if b"|" in text else b"",
        valid=lambda text: text.replace(b"|", b"-"),
    )


row(
    "sends-bars-in-names",
    "T/6",
    "A program name that contains a bar is sent.",
    _bars("delete_program", "set_default_program", "run_program", "simulate_program"),
)
row(
    "sends-bars-in-passwords",
    "T/6",
    "A password that contains a bar is sent.",
    _bars("login"),
    subtle=True,
)


@mutant("drops-bars-of-file-names", "T/6", subtle=True)
class DropsBarsOfFileNames(ClientCore):
    """File names are sent without their bars."""

    def upload(self, name: bytes, content: bytes) -> Upload:
        return super().upload(name.replace(b"|", b""), content)

    def download(self, name: bytes, *args: int) -> Download:
        return super().download(name.replace(b"|", b""), *args)


# Whole values


def _z_y_x(fields: list[bytes]) -> list[bytes]:
    speed, x, y, z, *angles = fields
    return [speed, z, y, x, *angles]


row(
    "cuts-passwords",
    "T/10",
    "Passwords are cut to eight characters.",
    request_fields("set_password", lambda fields: [text[:8] for text in fields]),
)


@mutant("cuts-long-names", "T/10", subtle=True)
class CutsLongNames(ClientCore):
    """Texts are cut to 30 bytes."""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        return super().command(name, value[:30] if isinstance(value, bytes) else value)


row(
    "drops-the-minus",
    "T/10",
    "The coordinates of the initial position are sent without signs.",
    request_data("set_initial_tool_position", lambda data: data.replace(b"-", b"")),
)
row(
    "sends-whole-numbers",
    "T/10",
    "The gripper center is sent without decimals.",
    _numbers(lambda number: str(int(number))),
)
row(
    "swaps-axes",
    "T/10",
    "The coordinates of a move are sent as z, y and x.",
    request_fields("set_tool_coordinates", _z_y_x),
)
row(
    "trims-names",
    "T/10",
    "Spaces at the ends of the name of a program to delete are not sent.",
    request_data("delete_program", bytes.strip),
    subtle=True,
)
row(
    "trims-names-of-runs",
    "T/10",
    "Spaces at the ends of the name of a program to run or simulate are not sent.",
    request_data("run_program", bytes.strip),
    request_data("simulate_program", bytes.strip),
    subtle=True,
)
row(
    "reuses-its-buffer",
    "T/10",
    "The name of a program to delete that is shorter than the previous one ends like that one.",
    request_over_last("delete_program"),
    subtle=True,
)


def _normalized(form: Literal["NFC", "NFD"]) -> Callable[[bytes], bytes]:
    def change(data: bytes) -> bytes:
        return unicodedata.normalize(form, data.decode(errors="surrogateescape")).encode(
            errors="surrogateescape"
        )

    return change


row(
    "composes-names",
    "T/10",
    "The characters of the name of a program to run or delete are composed.",
    request_data("run_program", _normalized("NFC")),
    request_data("delete_program", _normalized("NFC")),
    subtle=True,
)
row(
    "decomposes-names-of-files",
    "T/10",
    "The characters of the name of a file to upload or download are decomposed.",
    request_data("upload_name", _normalized("NFD")),
    request_data("download_name", _normalized("NFD")),
    subtle=True,
)
