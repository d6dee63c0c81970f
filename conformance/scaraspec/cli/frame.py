"""`scaraspec frame`: explain frames given as hexadecimal digits."""

from typing import Final

import click

from scaraspec.cli.problems import Problem
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.protocol.commands import parse_frame
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import Frame, Framer, Skipped
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage

EXAMPLE = "Example: scaraspec frame AA0900CC CC09023030AA"


_PARTS: Final = {
    "request": UserMessage("request"),
    "reply": UserMessage("reply"),
    "result": UserMessage("result"),
}


def _explain(frame: Frame) -> list[str]:
    """Return lines about a frame: sender, command, data and defects."""
    sender = localized("client" if frame.direction is Direction.A2C else "controller")
    parsed = parse_frame(frame)
    if parsed is None:
        text = "{frame}  {sender}: opcode {opcode:02X} is not defined"
        return [localized(text, frame=frame, sender=sender, opcode=frame.opcode)]
    line = localized(
        "{frame}  {sender}: {command} {part} {data}",
        frame=frame,
        sender=sender,
        command=parsed.command.name,
        part=_PARTS[parsed.part],
        data=show(frame.data),
    )
    lines = [line.rstrip()]
    lines += [localized("  wrong: {issue}", issue=each.text) for each in parsed.decoded.issues]
    lines += [
        localized("  reading: {reading}", reading=f"{k}={v}") for k, v in parsed.decoded.readings
    ]
    return lines


@click.command(epilog=EXAMPLE)
@click.argument("hexadecimal", nargs=-1, required=True)
def command(hexadecimal: tuple[str, ...]) -> None:
    """Explain the frames in HEXADECIMAL digits.

    Each argument is the bytes of one sender. The first byte, AA or CC, determines the sender. Exit
    status 1 if a byte belongs to no frame or a frame has a defect.
    """
    wrong = False
    for digits in hexadecimal:
        try:
            data = bytes.fromhex(digits)
        except ValueError:
            raise Problem(
                UserMessage(
                    "{digits!r} is not hexadecimal: write bytes like AA0900CC", digits=digits
                )
            ) from None
        if not data:
            raise Problem("no bytes given: write them like AA0900CC")
        direction = Direction.C2A if data[:1] == b"\xcc" else Direction.A2C
        framer = Framer(direction)
        for item in framer.feed(data) + framer.finish():
            if isinstance(item, Skipped):
                wrong = True
                reason = localized("no frame: {reason}", reason=localized(item.reason.value))
                click.echo(f"[{item.data.hex(' ').upper()}]  {reason}")
                continue
            parsed = parse_frame(item)
            wrong = wrong or parsed is None or bool(parsed.decoded.issues)
            click.echo("\n".join(_explain(item)))
    if wrong:
        raise SystemExit(ExitStatus.NONCONFORMANT)
