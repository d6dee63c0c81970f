"""Faults of clause 4.3: the network settings as they are told."""

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersLengths, AltersReplies

_GET_NETWORK = 0x04


@mutant("network-between-blanks", "4.3/2")
class NetworkBetweenBlanks(AltersReplies):
    """Address, mask and gateway are separated by blanks."""

    opcode = _GET_NETWORK

    def altered(self, data: bytes) -> bytes:
        """Take the bars away."""
        return data.replace(b"|", b" ")


@mutant("network-without-gateway", "4.3/2")
class NetworkWithoutGateway(AltersReplies):
    """The gateway is not told."""

    opcode = _GET_NETWORK

    def altered(self, data: bytes) -> bytes:
        """Leave the last field away."""
        return data.rpartition(b"|")[0]


@mutant("network-with-names", "4.3/2", "4.3/3")
class NetworkWithNames(AltersReplies):
    """Each field bears its name."""

    opcode = _GET_NETWORK

    def altered(self, data: bytes) -> bytes:
        """Add them."""
        names = (b"ip=", b"mask=", b"gw=")
        return b"|".join(a + b for a, b in zip(names, data.split(b"|"), strict=True))


@mutant("network-in-hexadecimal", "4.3/3")
class NetworkInHexadecimal(AltersReplies):
    """The parts of the addresses are hexadecimal."""

    opcode = _GET_NETWORK

    def altered(self, data: bytes) -> bytes:
        """Write them so."""
        fields = [
            b".".join(b"%X" % int(part) for part in field.split(b".")) for field in data.split(b"|")
        ]
        return b"|".join(fields)


@mutant("mask-of256", "4.3/3")
class MaskOf256(AltersReplies):
    """The mask is told as 256 in place of 255."""

    opcode = _GET_NETWORK

    def altered(self, data: bytes) -> bytes:
        """Count one too many."""
        return data.replace(b"255", b"256")


@mutant("network-length-as-printed", "4.3/4")
class NetworkLengthAsPrinted(AltersLengths):
    """The length byte is one short, as in the document's row."""

    opcode = _GET_NETWORK

    def length(self, size_bytes: int) -> int:
        """Miscount."""
        return size_bytes - 1


@mutant("network-length-of-the-fields-alone", "4.3/4")
class NetworkLengthOfTheFieldsAlone(AltersLengths):
    """The length byte counts the fields and not the bars."""

    opcode = _GET_NETWORK

    def length(self, size_bytes: int) -> int:
        """Leave two bars out."""
        return size_bytes - 2
