"""`scaraspec dissector`: the protocol in Wireshark."""

import click

from scaraspec.cli.problems import Problem, unwritable
from scaraspec.dissectors import wireshark as lua
from scaraspec.user_message import sentence_of

EXAMPLE = "Example: scaraspec dissector --wireshark --install"


@click.command(epilog=EXAMPLE)
@click.option("--wireshark", is_flag=True, required=True, help="The dissector for Wireshark (Lua).")
@click.option("--install", is_flag=True, help="Write it into your folder of Wireshark plugins.")
def command(*, wireshark: bool, install: bool) -> None:  # noqa: ARG001 - it names the only tool
    """Print or install a dissector, which shows the protocol in another tool.

    It is generated from the command table. Wireshark and tshark load it at their next start.
    """
    if not install:
        click.echo(lua.render(), nl=False)
        return
    try:
        path = lua.install()
    except lua.ForeignFileError as error:
        raise Problem(sentence_of(error)) from None
    except OSError as error:
        raise unwritable(error) from None
    click.echo(f"{path}")
