"""`scaraspec frame`: frames read from hexadecimal digits."""

import click

from scaraspec.cli.problems import Problem
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.protocol.commands import read
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import Frame, Framer, Skipped
from scaraspec.user_message import UserMessage

EXAMPLE = "Example: scaraspec frame AA0900CC CC09023030AA"


def _explain(frame: Frame) -> list[str]:
    """A frame in words: who, what, its data, and what is wrong with it."""
    sender = "client" if frame.direction is Direction.A2C else "controller"
    parsed = read(frame)
    if parsed is None:
        return [f"{frame}  {sender}: opcode {frame.opcode:02X} is not defined"]
    lines = [f"{frame}  {sender}: {parsed.command.name} {parsed.part} {show(frame.data)}".rstrip()]
    lines += [f"  wrong: {complaint.text}" for complaint in parsed.decoded.complaints]
    lines += [f"  reading: {key}={option}" for key, option in parsed.decoded.readings]
    return lines


@click.command(epilog=EXAMPLE)
@click.argument("hexadecimal", nargs=-1, required=True)
def command(hexadecimal: tuple[str, ...]) -> None:
    """Read the frames in HEXADECIMAL digits; exit 1 if any byte is no frame or anything is wrong.

    Each argument is the bytes of one sender; the first byte, AA or CC, says which.
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
            raise Problem("there are no bytes to read: write them like AA0900CC")
        direction = Direction.C2A if data[:1] == b"\xcc" else Direction.A2C
        framer = Framer(direction)
        for item in framer.feed(data) + framer.finish():
            if isinstance(item, Skipped):
                wrong = True
                click.echo(f"[{item.data.hex(' ').upper()}]  no frame: {item.why.value}")
                continue
            parsed = read(item)
            wrong = wrong or parsed is None or bool(parsed.decoded.complaints)
            click.echo("\n".join(_explain(item)))
    if wrong:
        raise SystemExit(ExitStatus.NONCONFORMANT)
