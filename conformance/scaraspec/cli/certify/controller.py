"""`scaraspec certify controller`: the suite acts as the client."""

from typing import Any

import click

from scaraspec.cli.certify.options import PATH, option, suite_options
from scaraspec.cli.help import GroupedCommand
from scaraspec.cli.options import Duration, Real
from scaraspec.cli.vocabulary import DEFAULT_PASSWORD

_GROUPS = {
    "The subject": (
        "password",
        "ics",
        "attended",
        "reply_timeout",
        "transfer_timeout",
        "wait_for",
        "wait_for_lock",
    ),
    "What to try": (
        *(
            "allow",
            "only",
            "rerun_from",
            "require",
            "require_coverage",
            "seed",
            "examples",
            "patience",
            "exhaustive",
            "fail_fast",
            "undefined_opcodes",
        ),
    ),
    "The run": ("out", "certification", "package", "state_dir", "yes", "dry_run"),
}
EXAMPLE = "Example: scaraspec certify controller tcp://192.168.1.2 --allow state --out run-1"


@click.command(cls=GroupedCommand, groups=_GROUPS, epilog=EXAMPLE)
@click.argument("url", required=False)
@option("password", envvar="SCARASPEC_PASSWORD", default=DEFAULT_PASSWORD)
@option("allow", default="")
@suite_options
@click.option(
    "--attended", is_flag=True, help="Ask an operator to do what the ICS has no hook for."
)
@option("reply-timeout", type=Duration())
@option("patience", type=Real(0, 100_000))
@option("undefined-opcodes")
@option("wait-for-lock", type=Duration(), default=0.0)
@option("wait-for", type=Duration(), default=0.0)
@option("state-dir", type=PATH, envvar="SCARASPEC_STATE")
@option("yes", "-y")
def command(**given: Any) -> None:
    """Certify the controller at URL; read-only unless --allow permits more.

    Settings and files are restored at the end, after Ctrl-C, and by the next run after a crash.
    Exit status 0 conformant, 1 nonconformant, 2 usage, 3 inconclusive or something is left on the
    controller, 4 nothing tested.
    """
    from scaraspec.cli.certify.controller_run import Settings, run  # noqa: PLC0415 - the suite

    run(Settings(**given))
