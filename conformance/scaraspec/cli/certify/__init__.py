"""`scaraspec certify`: run the suite against a controller or a client, and write a report."""

import click

from scaraspec.cli.certify import client, controller

EXAMPLE = controller.EXAMPLE


@click.group(context_settings={"help_option_names": ["-h", "--help"]}, epilog=EXAMPLE)
def command() -> None:
    """Certify a controller or a client against the protocol document.

    scaraspec is not a safety function: keep a hardware emergency stop within reach.
    """


command.add_command(controller.command, "controller")
command.add_command(client.command, "client")
