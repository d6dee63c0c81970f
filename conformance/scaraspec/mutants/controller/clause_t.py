"""Faults of the text conventions: separators, marks, digits, ends, numbers, codes, characters."""

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.connections import Mortal
from scaraspec.mutants.operators.controller.replies import AltersReplies
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

# Separators


@mutant("blanks-in-the-pose", "T/1")
class BlanksInThePose(AltersReplies):
    """The tool coordinates have blanks for bars, as the document is printed."""

    opcode = 0x38

    def altered(self, data: bytes) -> bytes:
        """Print them."""
        return data.replace(b"|", b" ")


@mutant("bars-between-blanks", "T/1")
class BarsBetweenBlanks(AltersReplies):
    """The network settings have blanks around their bars."""

    opcode = 0x04

    def altered(self, data: bytes) -> bytes:
        """Put them in."""
        return data.replace(b"|", b" | ")


@mutant("two-bars-between-temperatures", "T/1")
class TwoBarsBetweenTemperatures(AltersReplies):
    """Between the last two temperatures stand two bars."""

    opcode = 0x0F

    def altered(self, data: bytes) -> bytes:
        """Put one more in."""
        head, _, tail = data.rpartition(b"|")
        return head + b"||" + tail


@mutant("commas-between-angles", "T/1")
class CommasBetweenAngles(AltersReplies):
    """The joint angles have commas between them."""

    opcode = 0x3C

    def altered(self, data: bytes) -> bytes:
        """Put them in."""
        return data.replace(b"|", b",")


@mutant("blank-before-the-code", "T/1")
class BlankBeforeTheCode(ControllerCore):
    """Refusals have a blank before their code, as the document is printed."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Put it in."""
        if not frame.tagged and frame.data.startswith(b"0|") and len(frame.data) == 4:
            frame = frame._replace(data=frame.data.replace(b"|", b" "))
        super().emit(session, frame)


@mutant("blanks-in-lists", "T/1")
class BlanksInLists(AltersReplies):
    """The names of a program list have blanks behind their bars."""

    opcode = 0x0B

    def altered(self, data: bytes) -> bytes:
        """Put them in."""
        return data[:2] + data[2:].replace(b"|", b"| ")


# Marks and digits


@mutant("quotes-the-version", "T/2")
class QuotesTheVersion(AltersReplies):
    """The version stands in the quotation marks of the example."""

    opcode = 0x08

    def altered(self, data: bytes) -> bytes:
        """Put them around."""
        return b'"' + data + b'"'


@mutant("quotes-the-time", "T/2")
class QuotesTheTime(AltersReplies):
    """The time stands in typographic quotation marks."""

    opcode = 0x07

    def altered(self, data: bytes) -> bytes:
        """Put them around."""
        return "“".encode() + data + "”".encode()


@mutant("quotes-addresses", "T/2")
class QuotesAddresses(AltersReplies):
    """Each address of the network settings stands in quotation marks."""

    opcode = 0x04

    def altered(self, data: bytes) -> bytes:
        """Put them around."""
        return b'"' + data.replace(b"|", b'"|"') + b'"'


@mutant("binary-flag-of-inputs", "T/3")
class BinaryFlagOfInputs(AltersReplies):
    """The flag before the digital inputs is the byte 0x01."""

    opcode = 0x42

    def altered(self, data: bytes) -> bytes:
        """Put it in."""
        return bytes((data[0] - 0x30,)) + data[1:]


@mutant("binary-flag-of-downloads", "T/3")
class BinaryFlagOfDownloads(AltersReplies):
    """The flag that answers a download is a byte 0 or 1."""

    opcode = 0x54

    def altered(self, data: bytes) -> bytes:
        """Put it in."""
        return bytes((data[0] - 0x30,))


@mutant("binary-flag-of-settings", "T/3")
class BinaryFlagOfSettings(AltersReplies):
    """The flag that answers a gripper centre is a byte 0 or 1."""

    opcode = 0x35

    def altered(self, data: bytes) -> bytes:
        """Put it in."""
        return bytes((data[0] - 0x30,))


@mutant("time-in-packed-digits", "T/3")
class TimeInPackedDigits(AltersReplies):
    """The time is sent with two digits a byte."""

    opcode = 0x07

    def altered(self, data: bytes) -> bytes:
        """Pack it."""
        return bytes.fromhex(data.decode())


# Ends


@mutant("old-bytes-behind-the-version", "T/4")
class OldBytesBehindTheVersion(AltersReplies):
    """The version comes with the buffer behind it: a NUL, and what was in there before."""

    opcode = 0x08

    def altered(self, data: bytes) -> bytes:
        """Send the buffer."""
        return (data + b"\0").ljust(10, b"7")


@mutant("line-end-behind-angles", "T/4")
class LineEndBehindAngles(AltersReplies):
    """The joint angles end with a line end."""

    opcode = 0x3C

    def altered(self, data: bytes) -> bytes:
        """Put it behind."""
        return data + b"\r\n"


# Numbers


@mutant("comma-decimals", "T/5")
class CommaDecimals(AltersReplies):
    """The tool coordinates have a comma for the decimal point."""

    opcode = 0x38

    def altered(self, data: bytes) -> bytes:
        """Put it in."""
        return data.replace(b".", b",").replace(b"300|", b"300,0|")


@mutant("exponent-of-small-numbers", "T/5", subtle=True)
class ExponentOfSmallNumbers(AltersReplies):
    """Numbers below a tenth come with an exponent."""

    opcode = 0x34

    def altered(self, data: bytes) -> bytes:
        """Write them so."""
        texts = data.split(b"|")
        return b"|".join(b"%.1e" % float(t) if 0 < abs(float(t)) < 0.1 else t for t in texts)


@mutant("exponent-of-great-numbers", "T/5", subtle=True)
class ExponentOfGreatNumbers(AltersReplies):
    """Numbers from a hundred thousand on come with an exponent."""

    opcode = 0x34

    def altered(self, data: bytes) -> bytes:
        """Write them so."""
        texts = data.split(b"|")
        return b"|".join(b"%.1e" % float(t) if abs(float(t)) >= 1e5 else t for t in texts)


@mutant("plus-signs", "T/5")
class PlusSigns(AltersReplies):
    """The joint angles have a sign, also where it is a plus."""

    opcode = 0x3C

    def altered(self, data: bytes) -> bytes:
        """Put it in front."""
        return b"|".join(t if t[:1] == b"-" else b"+" + t for t in data.split(b"|"))


@mutant("nothing-for-zero", "T/5")
class NothingForZero(AltersReplies):
    """A zero among the coordinates of the tool is left away."""

    opcode = 0x38

    def altered(self, data: bytes) -> bytes:
        """Leave it away."""
        return b"|".join(b"" if t == b"0" else t for t in data.split(b"|"))


@mutant("temperature-is-no-number", "T/5")
class TemperatureIsNoNumber(AltersReplies):
    """The temperature of the last motor, which has no sensor, is nan."""

    opcode = 0x0F

    def altered(self, data: bytes) -> bytes:
        """Put it in."""
        return data.rpartition(b"|")[0] + b"|nan"


@mutant("no-zero-before-the-point", "T/5")
class NoZeroBeforeThePoint(AltersReplies):
    """Numbers below one begin with the point."""

    opcode = 0x34

    def altered(self, data: bytes) -> bytes:
        """Leave the zero away."""
        texts = (t.removeprefix(b"-") for t in data.split(b"|"))
        return b"|".join(t[1:] if t[:2] == b"0." else t for t in texts)


@mutant("takes-no-three-decimals", "T/5", subtle=True)
class TakesNoThreeDecimals(ControllerCore):
    """A gripper centre of three decimals is refused."""

    def set_gripper_center(self, request: Request) -> bool:
        """Refuse it."""
        long = any(len(t.partition(b".")[2]) > 2 for t in request.frame.data.split(b"|"))
        return not long and super().set_gripper_center(request)


# Codes


@mutant("state-in-words", "T/7")
class StateInWords(AltersReplies):
    """The status is a word."""

    opcode = 0x09

    def altered(self, data: bytes) -> bytes:
        """Say it."""
        return b"IDLE" if data == b"00" else b"RUNNING"


@mutant("codes-of-one-digit", "T/7")
class CodesOfOneDigit(ControllerCore):
    """The codes of refusals have no leading zero."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Take it away."""
        if not frame.tagged and frame.data.startswith(b"0|0") and len(frame.data) == 4:
            frame = frame._replace(data=b"0|" + frame.data[3:])
        super().emit(session, frame)


@mutant("codes-of-three-digits", "T/7")
class CodesOfThreeDigits(ControllerCore):
    """The codes of refused runs have three digits."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Put one more in."""
        if frame.opcode in (0x30, 0x31) and frame.data.startswith(b"0|"):
            frame = frame._replace(data=b"0|0" + frame.data[2:])
        super().emit(session, frame)


# Beyond ASCII


@mutant("dies-of-other-characters", "T/8", "3/31")
class DiesOfOtherCharacters(Mortal):
    """A name that is no ASCII ends the program."""

    def upload_name(self, request: Request) -> bool:
        """Die."""
        if not request.value.isascii():
            self.die(request.now_s)
        return super().upload_name(request)


@mutant("stores-names-in-latin", "T/8", "5.2/12")
class StoresNamesInLatin(ControllerCore):
    """Names are kept as if each of their bytes were a character, and looked for as UTF-8."""

    def upload_name(self, request: Request) -> bool:
        """Keep another name."""
        value = request.value.decode("latin-1").encode()
        return super().upload_name(
            Request(request.session, request.command, request.frame, value, request.now_s)
        )


@mutant("seven-bits-of-names", "T/8", "5.2/12", subtle=True)
class SevenBitsOfNames(ControllerCore):
    """Of each byte of a name that is stored the highest bit is lost."""

    def upload_name(self, request: Request) -> bool:
        """Keep another name."""
        value = bytes(byte & 0x7F for byte in request.value)
        return super().upload_name(
            Request(request.session, request.command, request.frame, value, request.now_s)
        )
