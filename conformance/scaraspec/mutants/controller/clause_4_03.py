"""Mutants of clause 4.3: the reported network settings."""

from scaraspec.mutants.controller import row
from scaraspec.mutants.operators.controller.replies import first_reply, length_byte


def _named(data: bytes) -> bytes:
    names = (b"ip=", b"mask=", b"gw=")
    return b"|".join(a + b for a, b in zip(names, data.split(b"|"), strict=True))


def _hexadecimal(data: bytes) -> bytes:
    fields = [field.split(b".") for field in data.split(b"|")]
    return b"|".join(b".".join(b"%X" % int(part) for part in parts) for parts in fields)


row(
    "network-between-blanks",
    "4.3/2",
    "Address, mask and gateway are separated by blanks.",
    first_reply("get_network", lambda data: data.replace(b"|", b" ")),
)
row(
    "network-without-gateway",
    "4.3/2",
    "The gateway is not reported.",
    first_reply("get_network", lambda data: data.rpartition(b"|")[0]),
)
row(
    "network-with-names",
    "4.3/2 4.3/3",
    "Each field begins with its name.",
    first_reply("get_network", _named),
)
row(
    "network-in-hexadecimal",
    "4.3/3",
    "The parts of the addresses are hexadecimal.",
    first_reply("get_network", _hexadecimal),
)
row(
    "mask-of256",
    "4.3/3",
    "The parts of the mask are 256 in place of 255.",
    first_reply("get_network", lambda data: data.replace(b"255", b"256")),
)
row(
    "network-length-as-printed",
    "4.3/4",
    "The length byte is one too small, as in the document's table.",
    length_byte("get_network", lambda size_bytes: size_bytes - 1),
)
row(
    "network-length-of-the-fields-alone",
    "4.3/4",
    "The length byte counts the fields but not the separators.",
    length_byte("get_network", lambda size_bytes: size_bytes - 2),
)
