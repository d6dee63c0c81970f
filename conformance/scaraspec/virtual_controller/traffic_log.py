"""The traffic log: one readable line for each frame, with passwords masked."""

from scaraspec.protocol.commands import BY_OPCODE, Command
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import Frame, Skipped, StreamItem
from scaraspec.protocol.redaction import is_secret
from scaraspec.protocol.transfer import FILE_DATA, Chunk

_MASK = "••••"


def format_line(connection: int, item: StreamItem) -> str:
    """Format a frame or skipped bytes: ``#1 > 0x09 get_status``, ``#1 < 0x09 get_status 00``."""
    if isinstance(item, Skipped):  # without its bytes: a damaged login contains the password
        return f"#{connection} > skipped {item.size_bytes} bytes: {item.reason.value}"
    arrow = ">" if item.direction is A2C else "<"
    command = BY_OPCODE.get(item.opcode)
    name = command.name if command else "unknown"
    words = [f"#{connection}", arrow, f"0x{item.opcode:02X}", name, _format_data(command, item)]
    if item.tagged:
        words.insert(-1, "result")
    return " ".join(words).rstrip()


def _format_data(command: Command | None, frame: Frame) -> str:
    payload = command.payload(frame) if command else None
    if is_secret(frame):
        return _MASK
    if payload is FILE_DATA:
        chunk: Chunk | None = FILE_DATA.decode(frame.data).value
        if chunk is not None:
            return f"{chunk.length} bytes at {chunk.position} of {chunk.file_size}"
    return show(frame.data)
