"""Rules as text; what they do to packets is tested on machines of the tests' own, in `net`."""

import re

import pytest

from scaraspec_recorder.forwarding.routes import GUARD_MARK, Mode, Redirect, Tproxy, Upstream, route
from scaraspec_recorder.forwarding.rules import Rules, text

CONTROLLER = ("192.168.1.2", 8877)
LISTEN = {
    Mode.EXPLICIT: ("192.168.1.9", 8878),
    Mode.REDIRECT: ("0.0.0.0", 8878),
    Mode.TPROXY: ("127.0.0.1", 8878),
}
LED = pytest.mark.parametrize("mode", [Mode.REDIRECT, Mode.TPROXY])


def rules(mode: Mode) -> Rules:
    return Rules(mode, LISTEN[mode], CONTROLLER)


@pytest.mark.parametrize("mode", Mode)
def test_the_text_says_all_there_is_to_know(mode: Mode) -> None:
    """Where from, where to, how to install, how to remove, how it fails; the rest is the script."""
    said = text(mode, LISTEN[mode], CONTROLLER)
    comment = [line for line in said.splitlines() if line.startswith("#")]
    assert said == "\n".join(comment) + "\n" + rules(mode).nft
    words = " ".join(line.removeprefix("#").strip() for line in comment)
    for fact in (
        "192.168.1.2:8877",
        f"{LISTEN[mode][0]}:8878",
        f"While no recorder runs, {rules(mode).failure}",
        *rules(mode).install,
        *rules(mode).remove,
    ):
        assert fact in words
    assert max(map(len, comment)) <= 80


def test_explicit_mode_needs_no_rules() -> None:
    """Clients connect to the recorder, so nothing is led aside, and any host name will do."""
    assert rules(Mode.EXPLICIT).nft == ""
    assert rules(Mode.EXPLICIT).install == rules(Mode.EXPLICIT).remove == ()
    assert "robot.example:8877" in text(Mode.EXPLICIT, ("::1", 8877), ("robot.example", 8877))


@LED
def test_only_the_first_packet_of_a_connection_is_led_aside(mode: Mode) -> None:
    """SYN without ACK, and only to the controller's port: a live session is not reset."""
    leading = re.findall(r"^.*\b(?:redirect|tproxy) to\b.*$", rules(mode).nft, re.MULTILINE)
    assert leading
    for statement in leading:
        assert "ip daddr 192.168.1.2 tcp dport 8877 tcp flags & (syn | ack) == syn" in statement


@LED
def test_all_that_is_installed_is_removed(mode: Mode) -> None:
    """Table, routing rule and route: what one list names, the other names."""
    names = re.compile(r"\b(?:scaraspec_\d+|0x[0-9a-f]+)\b")
    installed = set(names.findall(" ".join((*rules(mode).install, rules(mode).nft))))
    removed = set(names.findall(" ".join(rules(mode).remove)))
    assert installed - removed <= {hex(GUARD_MARK)}
    assert removed <= installed


@LED
def test_recorders_do_not_share_anything(mode: Mode) -> None:
    """Two on one machine have tables and marks of their own, and none has the guard mark."""
    one, other = (Rules(mode, (LISTEN[mode][0], port), CONTROLLER) for port in (8878, 8879))
    assert not set(one.remove) & set(other.remove)
    assert f"set {hex(GUARD_MARK)}" not in one.nft


def test_redirect_leaves_the_recorder_itself_alone() -> None:
    """What bears the guard mark goes out; who listens inside leads only this machine's clients."""
    nft = rules(Mode.REDIRECT).nft
    (own,) = [line for line in nft.split("chain ") if line.startswith("output")]
    assert f"meta mark != {hex(GUARD_MARK)} ip daddr" in own
    inside = Rules(Mode.REDIRECT, ("127.0.0.1", 8878), CONTROLLER)
    assert "chain prerouting" in nft
    assert "chain prerouting" not in inside.nft
    assert "packets this machine forwards" not in " ".join(str(inside).split())


@LED
@pytest.mark.parametrize(("listen", "controller"), [("::1", "127.0.0.1"), ("127.0.0.1", "robot")])
def test_rules_need_ipv4_addresses(mode: Mode, listen: str, controller: str) -> None:
    """A host name or an IPv6 address is refused in one sentence."""
    sentence = rf"^the mode {mode} needs IPv4 addresses, and '(::1|robot)' is none$"
    with pytest.raises(ValueError, match=sentence):
        text(mode, (listen, 8878), (controller, 8877))


def test_tproxy_needs_no_open_port() -> None:
    """Its listener stays on the loopback, where nobody else can reach it."""
    with pytest.raises(ValueError, match=r"listen on 127\.0\.0\.1$"):
        text(Mode.TPROXY, ("0.0.0.0", 8878), CONTROLLER)


def test_each_mode_has_its_route() -> None:
    """The rules lead clients to the recorder, and the route of the same mode leads them on."""
    assert route(Mode.EXPLICIT, *CONTROLLER) == Upstream(*CONTROLLER)
    assert route(Mode.REDIRECT, *CONTROLLER) == Redirect()
    assert route(Mode.TPROXY, *CONTROLLER) == Tproxy()
