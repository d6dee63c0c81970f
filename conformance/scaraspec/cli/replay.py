"""`scaraspec replay`: send recorded requests to a controller again."""

from collections import Counter
from pathlib import Path

import click

from scaraspec.cli.options import Duration, Real, capture_port, password_option
from scaraspec.cli.problems import Problem, unreadable
from scaraspec.cli.progress_bar import shown_share
from scaraspec.cli.vocabulary import DEFAULT_PASSWORD
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.sanitizing import visible_line
from scaraspec.translation import localized
from scaraspec.transports.link import LinkError
from scaraspec.transports.url import UrlError
from scaraspec.user_message import UserMessage, sentence_of
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.replay import MAX_GAP_S, LinkEndedError, ReplayStep

EXAMPLE = "Example: scaraspec replay capture.mcap tcp://127.0.0.1:8877 --allow state"

_MAX_SHOWN = 20


class _Tally:
    """Counts of sent and skipped messages, and of replies that differ."""

    def __init__(self) -> None:
        self._sent = self._results = self._different = 0
        self._skipped: Counter[tuple[str, str]] = Counter()
        self._shown: list[str] = []

    def add(self, step: ReplayStep) -> None:
        """Add a step that is done."""
        if step.is_result:
            self._results += 1
        elif step.frame:
            self._sent += 1
        else:
            self._skipped[step.name, step.reason] += 1
        if step.differs:
            self._different += 1
            if len(self._shown) < _MAX_SHOWN:
                missing = localized("no final result" if step.is_result else "no reply")
                line = localized(
                    "{name}: {now}, recorded: {recorded}",
                    name=step.name,
                    now=step.new_reply or missing,
                    recorded=step.recorded_reply,
                )
                self._shown.append(line)

    def report(self, connection: str, *, complete: bool) -> None:
        """Print the counts and exit with the matching status.

        Args:
            connection: The name of the connection.
            complete: Whether nothing is missing in the capture.

        Raises:
            SystemExit: A reply differs, nothing was sent, or the capture is incomplete.
        """
        total = self._sent + self._skipped.total()
        click.echo(
            localized(
                "sent {count} of {total} messages of the client of connection {connection}",
                count=self._sent,
                total=total,
                connection=connection,
            )
        )
        for (name, reason), count in self._skipped.most_common():
            text = "  skipped {count} {name} ({reason})"
            click.echo(localized(text, count=count, name=name, reason=localized(reason)))
        equal = self._sent + self._results - self._different
        text = "{equal} replies as in the capture, {different} different"
        click.echo(localized(text, equal=equal, different=self._different))
        for line in self._shown:
            click.echo(visible_line(f"  {line}"))
        if self._different > len(self._shown):
            hidden = self._different - len(self._shown)
            click.echo(localized("  and {count} more", count=hidden))
        if not self._sent:
            raise SystemExit(ExitStatus.NOTHING_TESTED)
        if self._different:
            raise SystemExit(ExitStatus.NONCONFORMANT)
        if not complete:
            raise SystemExit(ExitStatus.INCONCLUSIVE)


@click.command(epilog=EXAMPLE)
@click.argument("capture", type=click.Path(path_type=Path))
@click.argument("url")
@click.option(
    "--allow",
    default="",
    metavar="HAZARDS",
    help="Permit more than read-only requests: state,motion,destructive.",
)
@click.option(
    "--speed",
    type=Real(0.001, 1e6),
    metavar="FACTOR",
    help="Keep the times of the capture, FACTOR times as fast; without it, send at once.",
)
@click.option(
    "--max-gap",
    "max_gap_s",
    type=Duration(),
    default=MAX_GAP_S,
    show_default="60s",
    metavar="DURATION",
    help="With --speed, the longest pause of the capture that is kept.",
)
@click.option(
    "--connection", default="1", show_default=True, help="Number of the connection in the capture."
)
@password_option(DEFAULT_PASSWORD, "Password for the login over TCP")
@click.option(
    "--timeout",
    "timeout_s",
    type=Real(0.001, 1e6),
    default=5.0,
    metavar="S",
    help="Time to wait for a reply [5].",
)
@capture_port
def command(  # noqa: PLR0913, PLR0917 - a command line's options are its arguments
    capture: Path,
    url: str,
    allow: str,
    speed: float | None,
    max_gap_s: float,
    connection: str,
    password: str,
    timeout_s: float,
    port: int | None,
) -> None:
    """Send the requests of the client in CAPTURE to the controller at URL, in the same order.

    Only read-only requests are sent, unless --allow permits more. Undefined opcodes and malformed
    frames are never sent. The command logs in first, with --password. Before a request it waits for
    the final results that came before it in the capture. It prints what was skipped, and which
    replies have another meaning than in the capture; times, temperatures within 5 °C and poses
    within 0.2 mm are equal.

    Exit status: 0 all replies equal, 1 some differ, 3 link lost or CAPTURE incomplete, 4 nothing
    was sent.
    """
    from scaraspec.api.replaying import LoginFailedError, replay  # noqa: PLC0415 - slow to import
    from scaraspec_recorder.sources.capture import open_capture  # noqa: PLC0415 - slow to import

    tally = _Tally()
    try:
        source = open_capture(capture, port=port)
        with shown_share("replaying") as progress:
            for step in replay(
                source,
                url,
                allowed=_hazards(allow),
                password=password,
                connection=connection,
                reply_timeout_s=timeout_s,
                speed=speed,
                max_gap_s=max_gap_s,
                progress=progress,
            ):
                tally.add(step)
    except (CaptureError, PayloadError, UrlError) as error:
        raise unreadable(error) from None
    except LinkEndedError as error:
        raise Problem(
            UserMessage("{url}: {error}", url=url, error=error), ExitStatus.INCONCLUSIVE
        ) from None
    except (LinkError, LoginFailedError) as error:
        raise Problem(sentence_of(error), ExitStatus.INCONCLUSIVE) from None
    for note in source.summary.notes:
        click.echo(visible_line(f"{capture}: {note}"), err=True)
    if source.summary.losses:
        lost = UserMessage("gaps in the capture: {count}", count=source.summary.losses)
        click.echo(visible_line(f"{capture}: {lost}"), err=True)
    tally.report(connection, complete=source.summary.complete)


def _hazards(text: str) -> set[Hazard]:
    try:
        more = {Hazard(name.strip()) for name in text.split(",") if name.strip()}
    except ValueError as error:
        names = ", ".join(hazard.value for hazard in Hazard)
        raise Problem(
            UserMessage("--allow: {error}; use {names}", error=error, names=names)
        ) from None
    return {Hazard.READ_ONLY} | more
