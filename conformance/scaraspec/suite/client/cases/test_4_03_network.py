"""4.3: reading the network settings."""

from typing import Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.driver_values import matches
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import expect_reported, request_operation
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import given

_addresses: Final = st.ip_addresses(v=4).map(str)
_PADDED: Final = b"192.168.010.020|255.255.255.000|192.168.010.001"
_UNPADDED: Final = {"ip": "192.168.10.20", "mask": "255.255.255.0", "gateway": "192.168.10.1"}


@client_case("4.3/1", attended=True)
def test_example(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends get_network without data and reports the reply."""
    expect_reported(subject, line, "get_network", requirement="4.3/5")


@client_case("4.3/5")
def test_lengths(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The three addresses have every valid length from 7 to 15 characters."""

    @example("1.1.1.1", "0.0.0.0", "2.2.2.2")  # noqa: S104 - text of a reply, not bound to
    @example("255.255.255.254", "255.255.255.255", "192.168.100.100")
    @example("1.1.1.1", "255.255.255.252", "10.0.0.254")
    @example("192.168.100.200", "255.0.0.0", "9.9.9.9")
    @given(_addresses, _addresses, _addresses)
    def each(ip: str, mask: str, gateway: str) -> None:
        expect_reported(subject, line, "get_network", f"{ip}|{mask}|{gateway}".encode())

    each()


@client_case("4.3/5", name="padded")
def test_padded(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The addresses are padded with zeros; the client reports the same addresses or an error."""
    call, _ = request_operation(subject, line, "get_network")
    line.reply("get_network", data=_PADDED)
    subject.wait_for_answer(call)
    if not call.ok:
        subject.tolerate(
            "4.3/5", "A-4.3-2", "unpadded", "the client does not accept padded addresses"
        )
        return
    as_sent = dict(zip(_UNPADDED, _PADDED.decode().split("|"), strict=True))
    if not matches(call.result, as_sent):
        subject.expect_result(call, _UNPADDED)
