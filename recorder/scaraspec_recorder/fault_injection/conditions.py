"""Conditions that select frames by their content.

A condition checks one frame and has no state; `rules` counts frames.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple, Self

from scaraspec.protocol import commands
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame

PARTS: Final = ("request", "reply", "result")


class ObservedFrame(NamedTuple):
    """A received frame with its command name and part; the name of an undefined opcode is empty."""

    frame: Frame
    name: str
    part: str

    @classmethod
    def of(cls, frame: Frame) -> Self:
        """Decode the frame with the command table."""
        if parsed := commands.parse_frame(frame):
            return cls(frame, parsed.command.name, parsed.part)
        part = "result" if frame.tagged else "request" if frame.direction is A2C else "reply"
        return cls(frame, "", part)

    def __str__(self) -> str:
        return f"{self.name or f'0x{self.frame.opcode:02X}'} {self.part}"


@dataclass(frozen=True, slots=True)
class Condition:
    """Requirements on a frame; None matches anything.

    Attributes:
        command: A name of the command table, or an opcode.
        part: Part of the command, one of `PARTS`.
        direction: ``"A2C"`` or ``"C2A"``.
    """

    command: int | str | None = None
    part: str | None = None
    direction: str | None = None

    def matches(self, passing: ObservedFrame) -> bool:
        """Whether this frame matches."""
        frame, name, part = passing
        command = name if isinstance(self.command, str) else frame.opcode
        return (
            self.command in (None, command)
            and self.part in (None, part)
            and self.direction in (None, frame.direction.value)
        )

    def contradiction(self) -> str:
        """Return why no frame can match; empty if one can."""
        command = BY_NAME.get(self.command) if isinstance(self.command, str) else None
        if command is None:
            return ""
        if self.part == "result" and not command.two_stage:
            return f"{command.name} has no final result"
        initiator = command.initiator if self.part == "request" else command.initiator.opposite
        if self.part and self.direction not in (None, initiator.value):
            return f"the {self.part} of {command.name} goes {initiator.value}"
        return ""

    def __str__(self) -> str:
        command = f"0x{self.command:02X}" if isinstance(self.command, int) else self.command
        words = (command or "any", self.part or "frame", self.direction)
        return " ".join(word for word in words if word)
