"""`scaraspec driver-check`: check the driver of a client before a certification."""

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
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage

EXAMPLE = "Example: scaraspec driver-check 'scaraspec client-driver'"

_PASSWORD = "zs-password"  # noqa: S105 - used on the socket of this check only


@click.command(epilog=EXAMPLE)
@click.argument("command_line", metavar="COMMAND")
@click.option(
    "--timeout",
    "timeout_s",
    type=Real(0.1, 600),
    default=10.0,
    show_default=True,
    metavar="S",
    help="Time limit for each answer.",
)
def command(command_line: str, timeout_s: float) -> None:
    """Check that COMMAND is a driver of a client: JSON Lines on stdio.

    fixtures/drivers/README.md describes what a driver must do. Each step prints one line. Exit
    status 0 if all steps succeed, 1 if not.
    """
    try:
        driver = Driver(command_line)
        with closing(driver):
            for step in _steps(driver, timeout_s):
                click.echo(f"ok  {localized(step)}")
    except DriverError as error:
        click.echo(localized("WRONG  {error}", error=error))
        raise SystemExit(ExitStatus.NONCONFORMANT) from None


def _steps(driver: Driver, timeout_s: float) -> Iterator[str]:
    """Execute the steps and yield a sentence for each that succeeds.

    Raises:
        DriverError: A step failed.
    """
    yield "it starts"
    answer = driver.wait(driver.begin("levitate"), timeout_s)
    if not answer.unimplemented:
        raise DriverError(UserMessage("an unknown operation is answered {answer}", answer=answer))
    yield "an unknown operation is answered unimplemented"
    with closing(socket.create_server(("127.0.0.1", 0))) as listener:
        listener.settimeout(timeout_s)
        host, port = listener.getsockname()
        connecting = driver.begin("connect", host=host, port=port, password=_PASSWORD)
        with closing(_accepted(listener)) as link:
            link.settimeout(timeout_s)
            _serve(link, "login", _PASSWORD.encode(), b"1")
            _done(driver, connecting, timeout_s)
            yield "connect opens a connection and logs in with the given password"
            asking = driver.begin("get_status")
            _serve(link, "get_status", b"", b"00")
            _done(driver, asking, timeout_s)
            if asking.result != "00":
                raise DriverError(
                    UserMessage(
                        'get_status was answered 00, and the driver returned {asking}, not "00"',
                        asking=asking,
                    )
                )
            yield "get_status sends a request and returns the code of the reply"
            _done(driver, driver.begin("disconnect"), timeout_s)
            if link.recv(1):
                raise DriverError("disconnect sends data instead of closing the connection")
            yield "disconnect closes the connection"
    if driver.unmatched_lines:
        raise DriverError(
            UserMessage(
                "a line on stdout is no answer to a request: {strays}",
                strays=driver.unmatched_lines[0],
            )
        )


def _accepted(listener: socket.socket) -> socket.socket:
    try:
        return listener.accept()[0]
    except TimeoutError:
        raise DriverError("the driver was asked to connect and opened no connection") from None


def _serve(link: socket.socket, name: str, data: bytes, answer: bytes) -> None:
    """Wait for one request and answer it."""
    opcode = BY_NAME[name].opcode
    framer, wanted = Framer(A2C), Frame(A2C, opcode, data)
    while True:
        try:
            received = link.recv(4096)
        except TimeoutError:
            raise DriverError(
                UserMessage("the driver was asked for {name} and sent no request", name=name)
            ) from None
        if not received:
            raise DriverError(
                UserMessage(
                    "the driver closed the connection instead of sending the request {name}",
                    name=name,
                )
            )
        for found in framer.feed(received):
            if found != wanted:
                raise DriverError(
                    UserMessage(
                        "{name} was sent as {found}, expected {wanted}",
                        name=name,
                        found=found,
                        wanted=wanted,
                    )
                )
            link.sendall(Frame(C2A, opcode, answer).encode())
            return


def _done(driver: Driver, call: Call, timeout_s: float) -> None:
    if driver.wait(call, timeout_s).unimplemented:
        raise DriverError(UserMessage("the driver does not implement {call}", call=call.name))
    if not call.ok:
        raise DriverError(
            UserMessage(
                "{call} succeeded on the wire, and the driver returned {answer}",
                call=call.name,
                answer=call,
            )
        )
