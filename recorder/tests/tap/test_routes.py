"""Routes, and the recipes of the documentation that lead clients to them."""

import re
import shlex

import pytest

from recipes import recipe
from scaraspec_recorder.config import MODES, read_robot
from scaraspec_recorder.tap.routes import GUARD_MARK, Mode, Redirect, Tproxy, Upstream, route

CONTROLLER = ("192.168.1.2", 8877)
REDIRECTED = pytest.mark.parametrize("mode", [Mode.REDIRECT, Mode.TPROXY])


def redirecting_rules(mode: Mode) -> list[str]:
    found = re.findall(r"^.*\b(?:redirect|tproxy) to\b.*$", recipe(mode).script, re.MULTILINE)
    assert found
    return found


def test_each_mode_has_its_route() -> None:
    """The rules lead clients to the recorder, and the route of the same mode leads them on."""
    assert route(Mode.EXPLICIT, *CONTROLLER) == Upstream(*CONTROLLER)
    assert route(Mode.REDIRECT, *CONTROLLER) == Redirect()
    assert route(Mode.TPROXY, *CONTROLLER) == Tproxy()


@REDIRECTED
def test_the_documented_command_listens_where_the_rules_lead(mode: Mode) -> None:
    """The default of the mode; the recipe names no other."""
    *_, url, option, name = shlex.split(recipe(mode).record)
    robot = read_robot("r", {"url": url, option.removeprefix("--"): name}, "--")
    assert MODES[name] is robot.mode is mode
    host, _, port = robot.listen.partition(":")
    where = {Mode.REDIRECT: f"redirect to :{port};", Mode.TPROXY: f"tproxy to {host}:{port} "}
    for rule in redirecting_rules(mode):
        assert where[mode] in rule


@REDIRECTED
def test_the_documented_rules_match_only_the_first_packet_of_a_connection(mode: Mode) -> None:
    """SYN without ACK, and only to the controller's port: a live session is not reset."""
    for rule in redirecting_rules(mode):
        assert "ip daddr 192.168.1.2 tcp dport 8877 tcp flags & (syn | ack) == syn" in rule


def test_the_documented_loop_guard_is_the_mark_that_the_recorder_sets() -> None:
    """In the chain for the machine's own packets."""
    (output,) = [c for c in recipe(Mode.REDIRECT).script.split("chain ") if c.startswith("output")]
    assert f"meta mark != {GUARD_MARK:#x} ip daddr" in output


@REDIRECTED
def test_all_that_the_recipe_installs_is_removed(mode: Mode) -> None:
    """Table, routing rule and route: what one list names, the other names."""
    names = re.compile(r"\b(?:scaraspec_\d+|(?:fwmark|lookup|table) (?:0x[0-9a-f]+|\d+))\b")
    steps = recipe(mode)
    assert set(names.findall(steps.remove)) == set(names.findall(steps.install + steps.script))
