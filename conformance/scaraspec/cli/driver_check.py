"""`scaraspec driver-check`: what is wrong with a driver, before any certification."""

import socket
from collections.abc import Iterator
from contextlib import closing

import click

from scaraspec.cli.options import Real
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.driver import Driver, DriverError
from scaraspec.user_message import UserMessage

EXAMPLE = "Example: scaraspec driver-check 'scaraspec client-driver'"

_PASSWORD = "zs-password"  # noqa: S105 - it opens nothing but the check's own socket


@click.command(epilog=EXAMPLE)
@click.argument("command_line", metavar="COMMAND")
@click.option(
    "--timeout",
    "timeout_s",
    type=Real(0.1, 600),
    default=10.0,
    show_default=True,
    metavar="S",
    help="How long any answer may take.",
)
def command(command_line: str, timeout_s: float) -> None:
    """Check that COMMAND is a driver of a client: JSON Lines on stdio.

    What it has to understand and to say: fixtures/drivers/README.md. Each step is a line of its
    own. Exit status 0 if all is well, 1 if not.
    """
    try:
        driver = Driver(command_line)
        with closing(driver):
            for step in _steps(driver, timeout_s):
                click.echo(f"ok  {step}")
    except DriverError as error:
        click.echo(f"WRONG  {error}")
        raise SystemExit(ExitStatus.NONCONFORMANT) from None


def _steps(driver: Driver, timeout_s: float) -> Iterator[str]:
    """Do one thing after the other; what worked, in words.

    Raises:
        DriverError: What did not.
    """
    yield "it starts"
    made_up = driver.wait(driver.begin("levitate"), timeout_s)
    if not made_up.unimplemented:
        raise DriverError(
            UserMessage("an operation that nobody has is answered {made_up}", made_up=made_up)
        )
    yield "an operation that nobody has is answered unimplemented"
    with closing(socket.create_server(("127.0.0.1", 0))) as listener:
        listener.settimeout(timeout_s)
        host, port = listener.getsockname()
        connecting = driver.begin("connect", host=host, port=port, password=_PASSWORD)
        with closing(_accepted(listener)) as link:
            link.settimeout(timeout_s)
            _serve(link, "login", _PASSWORD.encode(), b"1")
            _done(driver, connecting, timeout_s)
            yield "connect opens a connection and logs in with the password given"
            asking = driver.begin("get_status")
            _serve(link, "get_status", b"", b"00")
            _done(driver, asking, timeout_s)
            if asking.result != "00":
                raise DriverError(
                    UserMessage(
                        'get_status was answered 00 and told as {asking}, not "00"', asking=asking
                    )
                )
            yield "get_status asks, and tells the code as it is on the wire"
            _done(driver, driver.begin("disconnect"), timeout_s)
            if link.recv(1):
                raise DriverError("disconnect sends something, and does not end the connection")
            yield "disconnect ends the connection"
    if driver.strays:
        raise DriverError(
            UserMessage("a line of its stdout answers nothing: {strays}", strays=driver.strays[0])
        )


def _accepted(listener: socket.socket) -> socket.socket:
    try:
        return listener.accept()[0]
    except TimeoutError:
        raise DriverError("connect was asked for and no connection came") from None


def _serve(link: socket.socket, name: str, data: bytes, answer: bytes) -> None:
    """Await one request, and answer it."""
    opcode = BY_NAME[name].opcode
    framer, wanted = Framer(A2C), Frame(A2C, opcode, data)
    while True:
        try:
            received = link.recv(4096)
        except TimeoutError:
            raise DriverError(
                UserMessage("{name} was asked for and no request came", name=name)
            ) from None
        if not received:
            raise DriverError(
                UserMessage("the connection was ended where a request of {name} was due", name=name)
            )
        for found in framer.feed(received):
            if found != wanted:
                raise DriverError(
                    UserMessage(
                        "{name} was sent as {found}, and should be {wanted}",
                        name=name,
                        found=found,
                        wanted=wanted,
                    )
                )
            link.sendall(Frame(C2A, opcode, answer).encode())
            return


def _done(driver: Driver, call: Call, timeout_s: float) -> None:
    if driver.wait(call, timeout_s).unimplemented:
        raise DriverError(UserMessage("the driver has no operation {call}", call=call.name))
    if not call.ok:
        raise DriverError(
            UserMessage(
                "{call} was answered on the wire and is told as {call_2}",
                call=call.name,
                call_2=call,
            )
        )
