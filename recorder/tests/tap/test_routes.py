"""Routes, and the recipes of the documentation that redirect clients to the recorder."""

import asyncio
import re
import shlex
import socket
import sys
from contextlib import ExitStack
from typing import Any

import pytest

from recipes import recipe
from scaraspec_recorder.config import MODES, read_robot
from scaraspec_recorder.tap import routes
from scaraspec_recorder.tap.routes import GUARD_MARK, Mode, Redirect, Tproxy, Upstream, route

CONTROLLER = ("192.168.1.2", 8877)
REDIRECTED = pytest.mark.parametrize("mode", [Mode.REDIRECT, Mode.TPROXY])


def redirecting_rules(mode: Mode) -> list[str]:
    found = re.findall(r"^.*\b(?:redirect|tproxy) to\b.*$", recipe(mode).script, re.MULTILINE)
    assert found
    return found


def test_each_mode_has_its_route() -> None:
    """The rules redirect clients to the recorder; the route of the mode connects to the target."""
    assert route(Mode.EXPLICIT, *CONTROLLER) == Upstream(*CONTROLLER)
    assert route(Mode.REDIRECT, *CONTROLLER) == Redirect()
    assert route(Mode.TPROXY, *CONTROLLER) == Tproxy()


@REDIRECTED
def test_the_documented_command_listens_at_the_redirected_port(mode: Mode) -> None:
    """The recipe uses the default of the mode."""
    *_, url, option, name = shlex.split(recipe(mode).record)
    robot = read_robot("r", {"url": url, option.removeprefix("--"): name}, "--")
    assert MODES[name] is robot.mode is mode
    host, _, port = robot.listen[0].partition(":")
    where = {Mode.REDIRECT: f"redirect to :{port};", Mode.TPROXY: f"tproxy to {host}:{port} "}
    for rule in redirecting_rules(mode):
        assert where[mode] in rule


@REDIRECTED
def test_the_documented_rules_match_only_the_first_packet_of_a_connection(mode: Mode) -> None:
    """SYN without ACK to the port of the controller: an existing session is not reset."""
    for rule in redirecting_rules(mode):
        assert "ip daddr 192.168.1.2 tcp dport 8877 tcp flags & (syn | ack) == syn" in rule


def test_the_documented_mark_is_that_of_the_recorder() -> None:
    """The mark is in the chain for local packets."""
    (output,) = [c for c in recipe(Mode.REDIRECT).script.split("chain ") if c.startswith("output")]
    assert f"meta mark != {GUARD_MARK:#x} ip daddr" in output


@REDIRECTED
def test_the_recipe_removes_everything_it_installs(mode: Mode) -> None:
    """Table, routing rule and route are in both lists."""
    names = re.compile(r"\b(?:scaraspec_\d+|(?:fwmark|lookup|table) (?:0x[0-9a-f]+|\d+))\b")
    steps = recipe(mode)
    assert set(names.findall(steps.remove)) == set(names.findall(steps.install + steps.script))


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse at once")
def test_an_address_that_does_not_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """The next address of the host is tried soon, and all are given up after a time."""
    monkeypatch.setattr(routes, "DIAL_TIMEOUT_S", 0.2)
    monkeypatch.setattr(routes, "NEXT_ADDRESS_S", 0.01)

    async def connect(addresses: list[Any]) -> Any:
        async def resolve(*_: Any, **__: Any) -> list[Any]:
            return [(socket.AF_INET, socket.SOCK_STREAM, 0, "", each) for each in addresses]

        monkeypatch.setattr(asyncio.get_running_loop(), "getaddrinfo", resolve)
        with await Upstream("robot", 8877).connect_upstream(client) as connected:
            return connected.getpeername()

    with ExitStack() as stack:
        silent = stack.enter_context(socket.create_server(("127.0.0.1", 0), backlog=0))
        robot = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        client = stack.enter_context(socket.create_connection(robot.getsockname()))
        # The queue of the listener is full, so that further clients get no reply.
        for _ in range(2):
            waiting = stack.enter_context(socket.socket())
            waiting.settimeout(0)
            waiting.connect_ex(silent.getsockname())
        found = asyncio.run(connect([silent.getsockname()] * 3 + [robot.getsockname()]))
        assert found == robot.getsockname()
        with pytest.raises(TimeoutError, match="timed out"):
            asyncio.run(connect([silent.getsockname()]))
