"""Entry point of the command line: the list of commands, error messages, exit statuses.

An error that a user or the machine has caused is printed as one sentence. Each command is a module
of this package. It is imported only when it is called, so a missing extra affects only the commands
that need it.
"""

import importlib
import sys
import traceback

import click
from click.shell_completion import CompletionItem

from scaraspec.cli.help import LocalizedContext, with_localized_help
from scaraspec.cli.options import language_option
from scaraspec.cli.problems import Problem
from scaraspec.cli.stdio import ending_alike, outliving_readers
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.sanitizing import visible
from scaraspec.translation import (
    localized,
    preferred_language,
    set_display_language,
    translated_error,
)

COMMANDS = {
    "archive": "Keep the traffic of many robots in one archive, and query it.",
    "audit": "Judge a capture: MCAP, pcap or pcapng.",
    "call": "Send one command to a controller.",
    "cases": "Show the cases of the suite; write the test specification.",
    "certify": "Certify an implementation against the document.",
    "client-driver": "Run the reference client as a driver (JSON Lines).",
    "compare": "Compare the results of two runs, or two captures.",
    "controller": "Run the virtual controller.",
    "convert": "Convert a capture to another format.",
    "demo": "Record and judge a complete session with the virtual controller.",
    "dissector": "Show the protocol in Wireshark.",
    "driver-check": "Check the driver of a client.",
    "exchanges": "Show the dialogue in a capture as text or tables.",
    "frame": "Explain frames given as hexadecimal digits.",
    "gate": "Compare the results of a run with what is accepted.",
    "ics": "Write or check an implementation conformance statement.",
    "merge": "Join the results of several sittings.",
    "program": "List, check or convert user program files.",
    "prove": "Run the suite against mutants (faulty implementations).",
    "record": "Record the traffic between a client and a controller.",
    "recover": "Repair recordings whose recorder was killed.",
    "replay": "Send recorded requests to a controller again.",
    "requirements": "Show requirements and register entries.",
    "verify": "Verify the result package of a certification.",
    "view": "Open a capture in the Rerun viewer.",
}
"""Each command with its one-line help. The module of the same name defines `command`."""


class _Lazy(click.Group):
    """A group that imports a command only when it is called; completion imports none."""

    context_class = LocalizedContext

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        found = click.Command.shell_complete(self, ctx, incomplete)  # the options
        names = () if incomplete.startswith("-") else COMMANDS.items()
        return found + [
            CompletionItem(name, help=localized(text))
            for name, text in names
            if name.startswith(incomplete)
        ]

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002 - click's signature
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"scaraspec.cli.{cmd_name.replace('-', '_')}")
        command = module.command
        assert isinstance(command, click.Command)
        return with_localized_help(command)

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:  # click would exit with 1, which means nonconformant
            raise Problem("interrupted", ExitStatus.INCONCLUSIVE) from None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002 - click's signature
        with formatter.section(localized("Commands")):
            formatter.write_dl([(name, localized(text)) for name, text in COMMANDS.items()])


def _print_version(ctx: click.Context, _option: click.Parameter, asked: bool) -> None:  # noqa: FBT001 - click's signature
    if asked:
        from scaraspec.version import version_text  # noqa: PLC0415 - only this option needs it

        click.echo(localized("scaraspec, version {version}", version=version_text()))
        ctx.exit()


@click.command(cls=_Lazy, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_version,
    help="Show the version and exit.",
)
@language_option
def group() -> None:
    """Certify, record and gate UISR4200S robot traffic.

    scaraspec is not a safety function: keep a hardware emergency stop within reach.
    """


def main() -> None:
    """Run the command line. README.md lists the exit statuses."""
    set_display_language(preferred_language())
    with outliving_readers(), ending_alike():
        try:
            group(prog_name="scaraspec")
        except Problem as problem:
            _print_error(translated_error(problem))
            sys.exit(problem.exit_status)
        except OSError as error:
            _print_error(translated_error(error))
        except Exception:  # noqa: BLE001 - Python would exit with 1, which means nonconformant
            traceback.print_exc()
            _print_error(localized("this is a defect of scaraspec; please report it"))
        sys.exit(ExitStatus.INCONCLUSIVE)


def _print_error(message: str) -> None:
    click.echo(f"scaraspec: {visible(message)}", err=True)
