"""The entry point: names the commands, tells what went wrong, and gives that no verdict.

What a user, or his machine, got wrong is one sentence.

Each command lives in a module of its own here and is imported only when it is called, so that
one that needs an absent extra hinders no other.
"""

import importlib
import sys
import traceback

import click

from scaraspec.cli.problems import Problem
from scaraspec.cli.stdio import ending_alike, outliving_readers
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.sanitizing import visible

COMMANDS = {
    "audit": "Judge a capture: MCAP, pcap or pcapng.",
    "call": "Send one command to a controller.",
    "certify": "Certify an implementation against the document.",
    "client-driver": "Drive the reference client by JSON Lines.",
    "controller": "Run the virtual controller.",
    "convert": "Write a capture again in another format.",
    "demo": "Record and judge a whole session, controller and client included.",
    "driver-check": "Say what is wrong with a client's driver.",
    "frame": "Read frames from hexadecimal digits.",
    "program": "List, check or convert user program files.",
    "prove": "Run the suite against seeded faults.",
    "record": "Record the traffic between a client and a controller.",
    "recover": "Repair recordings whose recorder was killed.",
    "replay": "Send what a recorded client sent to a controller again.",
    "requirements": "Show the catalogue of requirements.",
    "view": "Open a capture in the Rerun viewer.",
}
"""Every command and its one-line help; the module of its name holds it as `command`."""


class _Lazy(click.Group):
    """A group that knows its commands by name and imports the one that is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002 - click's signature
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"scaraspec.cli.{cmd_name.replace('-', '_')}")
        command = module.command
        assert isinstance(command, click.Command)
        return command

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:  # click would end it with 1, which says nonconformant
            raise Problem("ended before its end", ExitStatus.INCONCLUSIVE) from None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002 - click's signature
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.command(cls=_Lazy, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="scaraspec", prog_name="scaraspec")
def group() -> None:
    """Certify, record and gate UISR4200S robot traffic.

    scaraspec is no safety function: keep a hardware emergency stop within reach.
    """


def main() -> None:
    """Run the command line; exit statuses are those of the README."""
    with outliving_readers(), ending_alike():
        try:
            group(prog_name="scaraspec")
        except Problem as problem:
            _tell(f"{problem}")
            sys.exit(problem.exit_status)
        except OSError as error:
            _tell(f"{error}")
        except Exception:  # noqa: BLE001 - whatever it is, Python would end with 1: nonconformant
            traceback.print_exc()
            _tell("that is a defect of scaraspec, and no result")
        sys.exit(ExitStatus.INCONCLUSIVE)


def _tell(why: str) -> None:
    click.echo(f"scaraspec: {visible(why)}", err=True)
