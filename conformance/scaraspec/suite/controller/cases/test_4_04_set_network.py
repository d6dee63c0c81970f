"""Clause 4.4: set the network (0x05, L155-165).

If the robot applies the address, only mask and gateway are changed: another address would
interrupt the connection. Where this cannot happen, the address is changed, too.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from ipaddress import IPv4Network
from typing import Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.commands import Network
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.payloads import malformed, send_malformed
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.state.preserve import ensure_open, settings_preserved
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    NoReply,
    expect,
)
from scaraspec.user_message import UserMessage, sentence_of

_MASKS: Final = ("255.255.255.0", "255.255.0.0")


_PRIVATE: Final = (
    st.integers(0x0A000000, 0x0AFFFFFF)
    | st.integers(0xAC100000, 0xAC1FFFFF)
    | st.integers(0xC0A80000, 0xC0A8FFFF)
)
_LONGEST_NETWORK: Final = Network("192.168.200.150", "255.255.255.192", "192.168.200.190")


@st.composite
def _networks(draw: st.DrawFn) -> Network:
    """Private addresses with a gateway in the same net: each validation accepts them (A-4.4-2)."""
    net = IPv4Network((draw(_PRIVATE), draw(st.integers(16, 30))), strict=False)
    hosts = st.integers(1, net.num_addresses - 2)
    ip, gateway = draw(st.lists(hosts, min_size=2, max_size=2, unique=True))
    return Network(str(net[ip]), str(net.netmask), str(net[gateway]))


def _read(line: OutgoingConnection) -> Network:
    reply = line.ask("get_network")
    if not isinstance(reply.value, Network):
        message = "the network is not three IPv4 values with separators"
        raise CaseFailed(message, observed=f"{reply}", requirement="4.3/2")
    return reply.value


def _alternatives(current: Network) -> tuple[Network, Network]:
    """Return two networks with the same address, another mask and different gateways."""
    mask = _MASKS[current.mask == _MASKS[0]]
    prefix, _, host = current.ip.rpartition(".")
    first, second, *_ = (f"{prefix}.{part}" for part in (1, 254, 200) if f"{part}" != host)
    return Network(current.ip, mask, first), Network(current.ip, mask, second)


def _set(
    subject: ControllerUnderTest, line: OutgoingConnection, network: Network, *, retry: bool
) -> OutgoingConnection:
    """Set a network; return a connection on which it can be read.

    If the connection ends because of an earlier setting, the request may be lost. `retry` allows
    one more attempt in this case.

    Raises:
        CaseFailed: The network was refused.
    """
    try:
        reply = line.ask("set_network", network)
    except NoReply as error:
        if line.ending is None:
            raise CaseFailed(
                sentence_of(error),
                expected=error.expected,
                observed=error.observed,
                requirement="4.4/2",
            ) from None
        line = ensure_open(subject, line)
        if retry and _read(line) != network:
            return _set(subject, line, network, retry=False)
        message = "the connection ended instead of a reply to 0x05"
        subject.tolerate("4.4/3", "A-4.4-1", "no reply", message)
        return line
    expect(
        reply.accepted,
        "a valid network was not answered 1",
        expected="1",
        observed=f"{reply}",
        requirement="4.4/2",
    )
    return ensure_open(subject, line)


def _read_again(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> tuple[Network, OutgoingConnection]:
    """Return the network and the connection used: a new one if the old one ended late."""
    try:
        return _read(line), line
    except NoReply:
        if line.ending is None:
            raise
    line = ensure_open(subject, line)
    return _read(line), line


def _expect_set(
    subject: ControllerUnderTest, line: OutgoingConnection, network: Network, *, retry: bool
) -> OutgoingConnection:
    """Set a network as `_set` does, and read it back; return the connection then in use."""
    line = _set(subject, line, network, retry=retry)
    if subject.ics.network_applies == "after-restart":
        subject.hook("restart")
        line = ensure_open(subject, line)
    reported, line = _read_again(subject, line)
    expect(
        reported == network,
        "0x04 does not show the network that was set",
        expected="|".join(network),
        observed="|".join(reported),
        requirement="4.4/4",
    )
    return line


@contextmanager
def _network_restored(subject: ControllerUnderTest, line: OutgoingConnection) -> Iterator[None]:
    """Restore the network, and restart the controller if the network needs it to take effect."""
    try:
        with settings_preserved(subject, line, "network"):
            yield
    finally:
        if subject.ics.network_applies == "after-restart":
            with suppress(CaseInconclusive):
                subject.hook("restart")


@case("4.4/4", "4.4/2", "4.4/3")
def test_mask_and_gateway(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Another mask and another gateway are set and reported; the address stays."""
    alternatives = _alternatives(_read(line))
    with _network_restored(subject, line):
        for number, network in enumerate(examples((*alternatives, alternatives[0]))):
            line = _expect_set(subject, line, network, retry=number > 0)


@case("4.4/4", "4.4/2", name="address")
def test_address(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Any valid address, mask and gateway are set and reported."""
    if not subject.access.survives_address_change:
        raise CaseSkipped("another address would interrupt the connection to the controller")
    lines = [line]

    @example(_LONGEST_NETWORK)
    @given(_networks())
    def set_and_check(network: Network) -> None:
        lines[0] = _expect_set(subject, lines[0], network, retry=network != _LONGEST_NETWORK)

    with _network_restored(subject, line):
        set_and_check()


@case("4.4/5", "4.4/2")
def test_malformed(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An invalid address is not accepted, and a refused request changes nothing."""
    before = _read(line)
    alternative = _alternatives(before)[1]
    if subject.access.survives_address_change:
        alternative = alternative._replace(ip=_LONGEST_NETWORK.ip)
    with _network_restored(subject, line):
        for wrong in examples(malformed("set_network", alternative, subject.dialect)):
            result = send_malformed(subject, line, "set_network", wrong)
            line = result.line
            expect(
                not (result.accepted and wrong.firm),
                UserMessage("{wrong} was accepted as a network", wrong=wrong),
                expected="0",
                observed=f"{result}",
            )
            silent = result.answer is None and not wrong.firm  # it may have been accepted
            if result.accepted or silent:
                line = _set(subject, line, before, retry=True)
            elif (reported := _read(line)) != before:
                raise CaseFailed(
                    UserMessage(
                        "a network with {wrong} was refused but changed the network",
                        wrong=wrong,
                    ),
                    expected="|".join(before),
                    observed="|".join(reported),
                    requirement="4.4/2",
                )
