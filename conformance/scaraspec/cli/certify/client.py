"""`scaraspec certify client`: the suite acts as the controller."""

from typing import Any, Final

import click

from scaraspec.cli.certify.options import suite_options
from scaraspec.cli.help import GroupedCommand
from scaraspec.cli.options import Real

_GROUPS = {
    "The subject": ("driver", "listen", "attended", "ics", "transfer_timeout", "answer_timeout"),
    "What to try": (
        "only",
        "rerun_from",
        "require",
        "require_coverage",
        "seed",
        "examples",
        "exhaustive",
        "fail_fast",
    ),
    "The run": ("out", "certification", "package", "dry_run"),
}
EXAMPLE: Final = "Example: scaraspec certify client --driver 'scaraspec client-driver' --out run-1"


@click.command(cls=GroupedCommand, groups=_GROUPS, epilog=EXAMPLE)
@click.option("--driver", metavar="COMMAND", help="Driver that operates the client by JSON Lines.")
@click.option("--listen", metavar="HOST:PORT", help="Address for a client without a driver.")
@click.option(
    "--attended", is_flag=True, help="Instruct an operator, and ask what the client shows."
)
@click.option(
    "--answer-timeout",
    type=Real(0.1, 3600),
    metavar="S",
    help="Time limit for each operation [10; attended 600].",
)
@suite_options
def command(**given: Any) -> None:
    """Certify a client build: the suite acts as the controller.

    Check a driver first with scaraspec driver-check. Without a driver an operator works with the
    client (--listen, --attended); the same --out continues an earlier sitting. Exit status 0
    conformant, 1 nonconformant, 2 usage, 3 inconclusive, 4 nothing tested.
    """
    from scaraspec.cli.certify.client_run import run  # noqa: PLC0415 - imports the suite

    run(**given)
