"""`scaraspec certify`: the suite against a real subject, with a report that can be signed."""

import click

from scaraspec.cli.certify import client, controller

EXAMPLE = controller.EXAMPLE


@click.group(context_settings={"help_option_names": ["-h", "--help"]}, epilog=EXAMPLE)
def command() -> None:
    """Certify an implementation against the document.

    scaraspec is no safety function: keep a hardware emergency stop within reach.
    """


command.add_command(controller.command, "controller")
command.add_command(client.command, "client")
