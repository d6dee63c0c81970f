"""The journal: one readable line for each frame of an exchange; passwords are masked."""

from scaraspec.protocol.commands import BY_OPCODE, Command
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import Frame, Skipped, StreamItem
from scaraspec.protocol.redaction import is_secret
from scaraspec.protocol.transfer import FILE_DATA, Chunk

_MASK = "••••"


def format_line(connection: int, seen: StreamItem) -> str:
    """Tell what was seen on a connection: ``#1 > 0x09 get_status``, ``#1 < 0x09 get_status 00``."""
    if isinstance(seen, Skipped):  # never its bytes: a torn login holds the password too
        return f"#{connection} > skipped {seen.size_bytes} bytes: {seen.why.value}"
    arrow = ">" if seen.direction is A2C else "<"
    command = BY_OPCODE.get(seen.opcode)
    name = command.name if command else "unknown"
    words = [f"#{connection}", arrow, f"0x{seen.opcode:02X}", name, _said(command, seen)]
    if seen.tagged:
        words.insert(-1, "result")
    return " ".join(words).rstrip()


def _said(command: Command | None, frame: Frame) -> str:
    payload = command.payload(frame) if command else None
    if is_secret(frame):
        return _MASK
    if payload is FILE_DATA:
        chunk: Chunk | None = FILE_DATA.decode(frame.data).value
        if chunk is not None:
            return f"{chunk.length} bytes at {chunk.position} of {chunk.file_size}"
    return show(frame.data)
