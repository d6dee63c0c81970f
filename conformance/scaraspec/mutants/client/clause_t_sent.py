"""Faults of the text conventions in what a client sends: separators, marks, digits, numbers."""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any

from scaraspec.client.core import ClientCore
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.client.transfer import Download, Upload
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersRequests
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame

# Separators


@mutant("blanks-for-bars", "T/1")
class BlanksForBars(AltersRequests):
    """The network settings are sent with blanks for bars, as the document is printed."""

    name = "set_network"

    def altered(self, data: bytes) -> bytes:
        """Print them."""
        return data.replace(b"|", b" ")


@mutant("commas-for-bars", "T/1")
class CommasForBars(AltersRequests):
    """The gripper centre is sent with commas between its coordinates."""

    name = "set_gripper_center"

    def altered(self, data: bytes) -> bytes:
        """Put them in."""
        return data.replace(b"|", b",")


@mutant("blanks-around-bars", "T/1")
class BlanksAroundBars(AltersRequests):
    """A move is sent with blanks around its bars."""

    name = "set_tool_coordinates"

    def altered(self, data: bytes) -> bytes:
        """Put them in."""
        return data.replace(b"|", b" | ")


@mutant("two-bars", "T/1")
class TwoBars(AltersRequests):
    """Between the last two values of the initial position stand two bars."""

    name = "set_initial_tool_position"

    def altered(self, data: bytes) -> bytes:
        """Put one more in."""
        head, _, tail = data.rpartition(b"|")
        return head + b"||" + tail


@mutant("columns-for-bars", "T/1", subtle=True)
class ColumnsForBars(AltersRequests):
    """Two short passwords are sent with blanks that fill up a column between them."""

    name = "set_password"

    def altered(self, data: bytes) -> bytes:
        """Fill it up."""
        old, _, new = data.partition(b"|")
        return f"{old.decode():8}|".encode() + new


# Marks and digits


@mutant("quoted-names", "T/2")
class QuotedNames(AltersRequests):
    """The name of the program to run is sent between quotation marks."""

    name = "run_program"

    def altered(self, data: bytes) -> bytes:
        """Quote it."""
        return b'"' + data + b'"'


@mutant("curly-quotes", "T/2")
class CurlyQuotes(AltersRequests):
    """The time is sent between the curly quotation marks that the document prints."""

    name = "set_time"

    def altered(self, data: bytes) -> bytes:
        """Quote it."""
        return "“".encode() + data + "”".encode()


@mutant("binary-port", "T/3")
class BinaryPort(AltersRequests):
    """Port and value of an output are sent as bytes."""

    name = "set_digital_output"

    def altered(self, data: bytes) -> bytes:
        """Make them so."""
        return b"|".join(bytes((int(text),)) for text in data.split(b"|"))


@mutant("packed-time", "T/3", "4.5/1")
class PackedTime(AltersRequests):
    """The time is sent with two digits in a byte."""

    name = "set_time"

    def altered(self, data: bytes) -> bytes:
        """Pack them."""
        return bytes.fromhex(data.decode())


# Ends


@mutant("names-end-with-lines", "T/4")
class NamesEndWithLines(AltersRequests):
    """A line end follows the name of the program to simulate."""

    name = "simulate_program"

    def altered(self, data: bytes) -> bytes:
        """Append it."""
        return data + b"\r\n"


@mutant("time-ends-with-blanks", "T/4")
class TimeEndsWithBlanks(AltersRequests):
    """The time is filled up to sixteen characters with blanks."""

    name = "set_time"

    def altered(self, data: bytes) -> bytes:
        """Fill it up."""
        return data.ljust(16)


@mutant("rest-of-the-buffer", "T/4", subtle=True)
class RestOfTheBuffer(AltersRequests):
    """Behind the name of the default program come a NUL and what was in the buffer before."""

    name = "set_default_program"

    def altered(self, data: bytes) -> bytes:
        """Append it."""
        return data + b"\0xyz"


# Numbers


class _Numbers(AltersRequests, ABC):
    """Numbers are written otherwise."""

    name = "set_gripper_center"

    def altered(self, data: bytes) -> bytes:
        """Write them."""
        return b"|".join(self.written(float(text)).encode() for text in data.split(b"|"))

    @abstractmethod
    def written(self, number: float) -> str:
        """Write one."""


@mutant("exponents", "T/5", subtle=True)
class Exponents(_Numbers):
    """Large and small numbers are sent with an exponent."""

    def written(self, number: float) -> str:
        """Write it as many a language does; Java begins the latest with large ones."""
        return f"{number}" if 1e-3 <= abs(number) < 1e7 or not number else f"{number:e}"


@mutant("commas-for-points", "T/5")
class CommasForPoints(AltersRequests):
    """The decimals of the initial position stand behind a comma."""

    name = "set_initial_tool_position"

    def altered(self, data: bytes) -> bytes:
        """Put it in."""
        return data.replace(b".", b",")


@mutant("empty-for-zero", "T/5")
class EmptyForZero(_Numbers):
    """A zero is sent as an empty field."""

    def written(self, number: float) -> str:
        """Write it, or not."""
        return f"{number:.3f}" if number else ""


@mutant("no-zero-ahead-of-the-point", "T/5", subtle=True)
class NoZeroAheadOfThePoint(_Numbers):
    """Numbers below one are sent without the zero ahead of their point."""

    def written(self, number: float) -> str:
        """Leave it out."""
        return re.sub(r"\b0\.", ".", f"{number:.3f}")


# Bars in texts


class _SendsBars(ClientCore):
    """A bar in a text is sent."""

    names: tuple[str, ...]
    _barred = b""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        """Take it as if it had none."""
        if name in self.names and b"|" in value:
            self._barred, value = value, value.replace(b"|", b"-")
        return super().command(name, value)

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            meant = self._barred and frame.opcode in {BY_NAME[name].opcode for name in self.names}
            super()._send([frame._replace(data=self._barred) if meant else frame])
            self._barred = b"" if meant else self._barred


@mutant("sends-bars-in-names", "T/6")
class SendsBarsInNames(_SendsBars):
    """A name with a bar in it is sent."""

    names = ("delete_program", "set_default_program", "run_program", "simulate_program")


@mutant("sends-bars-in-passwords", "T/6", subtle=True)
class SendsBarsInPasswords(_SendsBars):
    """A password with a bar in it is sent."""

    names = ("login",)


@mutant("drops-bars-of-file-names", "T/6", subtle=True)
class DropsBarsOfFileNames(ClientCore):
    """The name of a file is sent without the bars in it."""

    def upload(self, name: bytes, content: bytes) -> Upload:
        """Drop them."""
        return super().upload(name.replace(b"|", b""), content)

    def download(self, name: bytes, *args: int) -> Download:
        """Drop them."""
        return super().download(name.replace(b"|", b""), *args)


# Whole values


@mutant("cuts-passwords", "T/10")
class CutsPasswords(AltersRequests):
    """Passwords are cut to eight characters."""

    name = "set_password"

    def altered(self, data: bytes) -> bytes:
        """Cut them."""
        return b"|".join(text[:8] for text in data.split(b"|"))


@mutant("cuts-long-names", "T/10", subtle=True)
class CutsLongNames(ClientCore):
    """The name of a program is cut to thirty bytes."""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        """Cut it."""
        return super().command(name, value[:30] if isinstance(value, bytes) else value)


@mutant("drops-the-minus", "T/10")
class DropsTheMinus(AltersRequests):
    """The coordinates of the initial position are sent without their signs."""

    name = "set_initial_tool_position"

    def altered(self, data: bytes) -> bytes:
        """Drop them."""
        return data.replace(b"-", b"")


@mutant("sends-whole-numbers", "T/10")
class SendsWholeNumbers(_Numbers):
    """The gripper centre is sent without its decimals."""

    def written(self, number: float) -> str:
        """Cut it."""
        return str(int(number))


@mutant("swaps-axes", "T/10")
class SwapsAxes(AltersRequests):
    """The coordinates of a move are sent in another order."""

    name = "set_tool_coordinates"

    def altered(self, data: bytes) -> bytes:
        """Swap them."""
        speed, x, y, z, *angles = data.split(b"|")
        return b"|".join((speed, z, y, x, *angles))


@mutant("trims-names", "T/10", subtle=True)
class TrimsNames(AltersRequests):
    """Blanks at either end of a name are not sent: another program is deleted than was named."""

    name = "delete_program"

    def altered(self, data: bytes) -> bytes:
        """Trim it."""
        return data.strip()


@mutant("trims-names-of-runs", "T/10", subtle=True)
class TrimsNamesOfRuns(ClientCore):
    """Blanks at either end of a name are not sent: another program is run than was named."""

    def _send(self, frames: Iterable[Frame]) -> None:
        runs = (BY_NAME["run_program"].opcode, BY_NAME["simulate_program"].opcode)
        super()._send(
            frame._replace(data=frame.data.strip()) if frame.opcode in runs else frame
            for frame in frames
        )


@mutant("reuses-its-buffer", "T/10", subtle=True)
class ReusesItsBuffer(ClientCore):
    """A name that is shorter than the one before has the end of that one behind it."""

    _buffer = b""

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            if frame.opcode == BY_NAME["delete_program"].opcode:
                self._buffer = frame.data + self._buffer[len(frame.data) :]
                frame = frame._replace(data=self._buffer)  # noqa: PLW2901 - what goes out
            super()._send([frame])
