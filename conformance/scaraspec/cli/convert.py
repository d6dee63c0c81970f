"""`scaraspec convert`: convert a capture to another format."""

from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from scaraspec.cli.options import Instant, capture_port
from scaraspec.cli.problems import Problem, unreadable
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError

if TYPE_CHECKING:
    from scaraspec_recorder.sources.excerpt import Excerpt

EXAMPLE = "Example: scaraspec convert field.pcapng field.mcap --since 2026-11-21T08:15 --redact"

_PATH = click.Path(path_type=Path)


def _write_mcap(capture: "Excerpt", target: Path) -> None:
    from scaraspec.judge.judge import Judge  # noqa: PLC0415 - --help does not need the judge
    from scaraspec_recorder.sinks.decoder import Decoder  # noqa: PLC0415 - for the same reason
    from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink  # noqa: PLC0415 - nor the writer

    sink = McapSink(target.open("wb"), capture.session)
    decoder = Decoder([sink], Judge(needs_login=capture.needs_login))
    for event in capture:
        decoder.write(event)
    decoder.close()


def _draw(capture: "Excerpt", target: Path) -> None:
    from scaraspec_recorder.recordings.capture import write_rrd  # noqa: PLC0415 - slow to import

    write_rrd(capture, target, needs_login=capture.needs_login)


def _write_pcapng(capture: "Excerpt", target: Path) -> None:
    from scaraspec_recorder.sinks.pcapng_writer import PcapngWriter  # noqa: PLC0415 - as above

    with target.open("wb") as file:
        writer = PcapngWriter(file)
        for event in capture:
            writer.write(event)
    if writer.shortened_gaps:
        note = UserMessage(
            "{count} gaps of unknown length were written as gaps of one byte",
            count=writer.shortened_gaps,
        )
        click.echo(f"{target}: {note}", err=True)


_WRITERS: Final = {
    ".mcap": _write_mcap,
    ".pcapng": _write_pcapng,
    ".rrd": _draw,
}


@click.command(epilog=EXAMPLE)
@click.argument("source", metavar="IN", type=_PATH)
@click.argument("target", metavar="OUT", type=_PATH)
@click.option("--since", type=Instant(), help="Only from this time on: 2026-11-21T08:15 (UTC).")
@click.option("--until", type=Instant(), help="Only before this time.")
@click.option("--redact", is_flag=True, help="Mask passwords, also in the raw bytes.")
@capture_port
def command(  # noqa: PLR0913 - two arguments and independent options
    source: Path,
    target: Path,
    since: int | None,
    until: int | None,
    port: int | None,
    *,
    redact: bool,
) -> None:
    """Convert the capture IN to OUT. The suffix of OUT selects the format: .mcap, .pcapng or .rrd.

    IN is MCAP, pcap or pcapng. OUT must not exist. MCAP is decoded again. In .pcapng the packets
    around the bytes are artificial, and bytes that were not recorded are missing segments. Exit
    status 3 if IN is incomplete; OUT then contains what could be read.

    With --since and --until OUT is an excerpt. What its connections sent before is a gap in it.
    """
    from scaraspec_recorder.sources.capture import open_capture  # noqa: PLC0415 - slow to import
    from scaraspec_recorder.sources.excerpt import Excerpt  # noqa: PLC0415 - for the same reason

    if target.suffix.lower() not in _WRITERS:
        raise Problem(
            UserMessage(
                "{target} has no known suffix: use one of {writers}",
                target=target,
                writers=", ".join(_WRITERS),
            )
        )
    try:
        capture = open_capture(source, port=port)
        excerpt = Excerpt(capture, since_ns=since, until_ns=until, redact=redact)
        target.touch(exist_ok=False)
    except CaptureError as error:
        raise unreadable(error) from None
    except FileExistsError:
        raise Problem(
            UserMessage("{target} exists: name a file that does not", target=target)
        ) from None
    except OSError as error:
        raise Problem(
            UserMessage(
                "{target} cannot be written: {strerror}", target=target, strerror=error.strerror
            )
        ) from None
    _write(excerpt, target)
    for note in capture.summary.notes:
        click.echo(f"{source}: {note}", err=True)
    if excerpt.empty and (since is not None or until is not None):
        target.unlink()
        raise Problem(UserMessage("{source} has no traffic in this time", source=source))
    if not capture.summary.complete:
        raise SystemExit(ExitStatus.INCONCLUSIVE)


def _write(excerpt: "Excerpt", target: Path) -> None:
    """Write the target, or remove it if that fails."""
    try:
        _WRITERS[target.suffix.lower()](excerpt, target)
    except (CaptureError, ImportError) as error:
        target.unlink()
        raise unreadable(error) from None
    except OSError as error:
        target.unlink()
        raise Problem(
            UserMessage(
                "{target} cannot be written: {strerror}", target=target, strerror=error.strerror
            )
        ) from None
    except BaseException:  # interrupted: remove the incomplete file
        target.unlink()
        raise
