"""4.4: setting the network."""

from typing import Final

import pytest
from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.commands import Network
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import request_operation
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import given

_addresses: Final = st.ip_addresses(v=4, network="10.0.0.0/8").map(str)
_MASKS: Final = ("255.0.0.0", "255.255.0.0", "255.255.255.0", "255.255.255.252")
_OTHER: Final = Network("192.168.100.200", "255.255.255.128", "192.168.100.254")
"""As ordinary as the example of the document: no open point allows a client to refuse it."""

_READ_S: Final = 1.0


@client_case("4.4/1")
def test_example(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Setting the network to the example of the document is refused."""
    call, _ = request_operation(subject, line, "set_network")
    line.reply("set_network", data=b"0")
    subject.expect_failure(call)


@client_case("4.4/1", name="addresses")
def test_addresses(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends address, mask and gateway completely and in this order."""

    @example("1.1.1.1", "255.255.255.252", "2.2.2.2")
    @given(_addresses, st.sampled_from(_MASKS), _addresses)
    def each(ip: str, mask: str, gateway: str) -> None:
        with subject.allow_refusal():
            sent(Network(ip, mask, gateway))

    def sent(network: Network) -> None:
        call, _ = request_operation(subject, line, "set_network", network)
        line.reply("set_network", data=b"0")
        subject.expect_failure(call)

    sent(_OTHER)
    each()


@client_case("4.4/6", attended=True)
def test_link_ends_after_success(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The link ends after the network was set; the client reports success and reconnects."""
    _lose(subject, line, cut=False)
    _lose(subject, subject.open(), cut=True)


def _lose(subject: ClientUnderTest, line: IncomingConnection, *, cut: bool) -> None:
    call, _ = request_operation(subject, line, "set_network")
    line.reply("set_network", data=b"1")
    if cut:
        subject.answers_within(call, _READ_S)  # a reset discards data that was not read
        line.reset()
    else:
        line.close()
    subject.expect_done(call)
    subject.wait_for_answer(subject.begin("disconnect"))


@pytest.mark.parametrize("cut", [False, True], ids=["closed", "cut-off"])
@client_case("T/9", name="network-unanswered")
def test_link_is_lost_before_the_answer(
    subject: ClientUnderTest, line: IncomingConnection, *, cut: bool
) -> None:
    """The link ends before the new network is accepted; the client reports a failure."""
    call, _ = request_operation(subject, line, "set_network")
    line.reset() if cut else line.close()
    subject.expect_failure(call)
