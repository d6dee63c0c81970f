"""`scaraspec replay`: what a recorded client sent, sent to a controller again."""

from collections import Counter
from pathlib import Path

import click

from scaraspec.cli.options import DEFAULT_PASSWORD, Real, capture_port, password_option
from scaraspec.cli.problems import Problem
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.transports.connect import connect
from scaraspec.transports.link import Link, LinkError
from scaraspec.transports.url import Tcp, parse
from scaraspec.user_message import UserMessage
from scaraspec_recorder.problems import CaptureError
from scaraspec_recorder.replay import LinkEndedError, Step, play, steps
from scaraspec_recorder.sources.capture import open_capture

EXAMPLE = "Example: scaraspec replay capture.mcap tcp://127.0.0.1:8877 --allow state"

_MOST_SHOWN = 20
_LOGIN = BY_NAME["login"]


class _Tally:
    """What was sent, what was not, and what came of it."""

    def __init__(self) -> None:
        self._sent = self._different = 0
        self._skipped: Counter[tuple[str, str]] = Counter()
        self._shown: list[str] = []

    def add(self, step: Step) -> None:
        if not step.frame:
            self._skipped[step.name, step.reason] += 1
            return
        self._sent += 1
        if step.differs:
            self._different += 1
            if len(self._shown) < _MOST_SHOWN:
                now = step.answered or "no answer"
                self._shown.append(f"{step.name}: {now}, recorded was {step.recorded}")

    def tell(self, connection: str) -> None:
        """Print it, and end with the status that follows from it."""
        total = self._sent + self._skipped.total()
        click.echo(
            f"sent {self._sent} of {total} messages of the client of connection {connection}"
        )
        for (name, reason), count in self._skipped.most_common():
            click.echo(f"  skipped {count} {name} ({reason})")
        alike = self._sent - self._different
        click.echo(f"{alike} answers as in the capture, {self._different} different")
        for line in self._shown:
            click.echo(f"  {line}")
        if self._different > len(self._shown):
            click.echo(f"  and {self._different - len(self._shown)} more")
        if not self._sent:
            raise SystemExit(ExitStatus.NOTHING_TESTED)
        if self._different:
            raise SystemExit(ExitStatus.NONCONFORMANT)


@click.command(epilog=EXAMPLE)
@click.argument("capture", type=click.Path(path_type=Path))
@click.argument("url")
@click.option(
    "--allow",
    default="",
    metavar="HAZARDS",
    help="What may be sent beside read-only requests: state,motion,destructive.",
)
@click.option(
    "--speed",
    type=Real(0.001, 1e6),
    metavar="FACTOR",
    help="Keep the capture's times, so much faster; without it, send at once.",
)
@click.option("--connection", default="1", show_default=True, help="Which one of the capture.")
@password_option(DEFAULT_PASSWORD, "What to log in with over TCP")
@click.option(
    "--timeout",
    "timeout_s",
    type=Real(0.001, 1e6),
    default=5.0,
    metavar="S",
    help="How long to wait for a reply (5 s).",
)
@capture_port
def command(  # noqa: PLR0913, PLR0917 - a command line's options are its arguments
    capture: Path,
    url: str,
    allow: str,
    speed: float | None,
    connection: str,
    password: str,
    timeout_s: float,
    port: int | None,
) -> None:
    """Send what the client in CAPTURE sent to the controller at URL, in the same order.

    Only read-only requests are sent, unless --allow names more; undefined opcodes and malformed
    frames never are. Logs in first, with a password of its own. Says what was skipped and which
    answers are of another kind than in the capture; values are not compared.

    Exit status: 0 all answers alike, 1 some are not, 3 link lost, 4 nothing was sent.
    """
    allowed = _hazards(allow)
    try:
        over = parse(url)
    except LinkError as error:
        raise Problem(str(error)) from None
    try:
        source = open_capture(capture, port=port)
        link = connect(url)
        try:
            if isinstance(over, Tcp):
                _log_in(link, password, timeout_s)
            plan = steps(source, connection, allowed)
            tally = _Tally()
            for step in play(plan, link, reply_timeout_s=timeout_s, speed=speed):
                tally.add(step)
        finally:
            link.close()
    except (CaptureError, PayloadError) as error:
        raise Problem(str(error)) from None
    except LinkEndedError as error:
        raise Problem(
            UserMessage("{url}: {error}", url=url, error=error), ExitStatus.INCONCLUSIVE
        ) from None
    except LinkError as error:
        raise Problem(str(error), ExitStatus.INCONCLUSIVE) from None
    tally.tell(connection)


def _hazards(text: str) -> set[Hazard]:
    try:
        more = {Hazard(name.strip()) for name in text.split(",") if name.strip()}
    except ValueError as error:
        names = ", ".join(hazard.value for hazard in Hazard)
        raise Problem(
            UserMessage("--allow: {error}; there are {names}", error=error, names=names)
        ) from None
    return {Hazard.READ_ONLY} | more


def _log_in(link: Link, password: str, timeout_s: float) -> None:
    frame = Frame(A2C, _LOGIN.opcode, _LOGIN.request.encode(password.encode()))
    (step,) = play((Step("login", 0, frame),), link, reply_timeout_s=timeout_s)
    if step.answered != "yes":
        what = "refuses the password" if step.answered else "does not answer the login"
        raise Problem(
            UserMessage("the controller {what}: name another with --password", what=what),
            ExitStatus.INCONCLUSIVE,
        )
