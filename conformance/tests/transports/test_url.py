"""Link URLs: parsing, and the error messages for invalid URLs."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.transports.url import (
    Rfcomm,
    Serial,
    Tcp,
    UrlError,
    join_host_port,
    parse,
    split_host_port,
)


@pytest.mark.parametrize(
    ("url", "address"),
    [
        ("tcp://192.168.1.2", Tcp("192.168.1.2", 8877)),
        ("tcp://robot.local:9000", Tcp("robot.local", 9000)),
        ("tcp://robot:1/", Tcp("robot", 1)),
        ("TCP://robot:65535", Tcp("robot", 65535)),
        ("tcp://[::1]", Tcp("::1", 8877)),
        ("tcp://[fe80::1%eth0]:8878", Tcp("fe80::1%eth0", 8878)),
        ("serial:///dev/rfcomm0", Serial("/dev/rfcomm0", 115200)),
        ("serial:///dev/ttyUSB0?baud=9600", Serial("/dev/ttyUSB0", 9600)),
        ("serial:///dev/a%20b", Serial("/dev/a b")),
        ("serial://COM3", Serial("COM3")),
        ("rfcomm://AA:BB:CC:DD:EE:FF/1", Rfcomm("AA:BB:CC:DD:EE:FF", 1)),
        ("rfcomm://aa:bb:cc:dd:ee:0f", Rfcomm("AA:BB:CC:DD:EE:0F", 1)),
        ("rfcomm://aa:bb:cc:dd:ee:0f/30", Rfcomm("AA:BB:CC:DD:EE:0F", 30)),
    ],
)
def test_parse_and_format(url: str, address: Tcp | Serial | Rfcomm) -> None:
    """Each scheme has defaults; a formatted address is parsed to the same address."""
    assert parse(url) == address
    if url != "serial:///dev/a%20b":
        assert parse(str(address)) == address


def test_login_and_end_of_a_connection() -> None:
    """Only TCP needs a login; only a serial line does not show the end of a connection."""
    links = (Tcp("robot"), Rfcomm("AA:BB:CC:DD:EE:FF"), Serial("COM3"))
    assert [link.needs_login for link in links] == [True, False, False]
    assert [link.detects_close for link in links] == [True, True, False]


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("", "is not a link URL: write for example tcp://"),
        ("192.168.1.2:8877", "is not a link URL"),
        ("robot", "is not a link URL"),
        ("http://robot", "is not a link URL"),
        ("tcp://", "has no valid host"),
        ("tcp://:8877", "has no valid host"),
        ("tcp://robot:", "not a valid port: it must be a number from 1 to 65535"),
        ("tcp://robot:0", "not a valid port"),
        ("tcp://robot:65536", "not a valid port"),
        ("tcp://robot:٣", "not a valid port"),
        ("tcp://robot:" + "9" * 5000, "not a valid port"),
        ("tcp://::1:8877", "write an IPv6 address as [::1:8877]:8877"),
        ("tcp://[robot]:8877", "is not a link URL"),
        ("tcp://[::1", "is not a link URL"),
        ("tcp://[::1]8877", "has no valid host"),
        ("tcp://user@robot", "is not a link URL"),
        ("tcp://robot/path", "is not a link URL"),
        ("tcp://robot?baud=1", "is not a link URL"),
        ("tcp://robot#a", "is not a link URL"),
        ("tcp://ro bot", "has no valid host"),
        ("tcp://robot\n", "is not a link URL"),
        ("serial://", "is not a link URL"),
        ("serial:///dev/x?baud=fast", "not a valid baud rate"),
        ("serial:///dev/x?baud=0", "not a valid baud rate"),
        ("serial:///dev/x?speed=9600", "not a valid setting of a serial link: write ?baud=115200"),
        ("serial:///dev/x?baud=1&baud=2", "not a valid setting"),
        ("rfcomm://AA:BB:CC:DD:EE/1", "is not a link URL"),
        (
            "rfcomm://AA:BB:CC:DD:EE:FF/31",
            "not a valid RFCOMM channel: it must be a number from 1 to 30",
        ),
        ("rfcomm://AA:BB:CC:DD:EE:FF/x", "not a valid RFCOMM channel"),
    ],
)
def test_invalid_url(url: str, message: str) -> None:
    """The message states the error and a valid form."""
    with pytest.raises(UrlError) as raised:
        parse(url)
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


@given(url=st.text(max_size=60) | st.text(max_size=40).map("tcp://".__add__))
def test_any_text_is_parsed_or_raises(url: str) -> None:
    """Any text gives an address or a `UrlError`."""
    try:
        address = parse(url)
    except UrlError:
        return
    assert address


def test_split_host_port_with_port_0() -> None:
    """A listener may use port 0, which means any free port."""
    assert split_host_port("127.0.0.1:0", lowest_port=0) == ("127.0.0.1", 0)
    assert join_host_port("::1", 5) == "[::1]:5"
    with pytest.raises(UrlError, match="'robot' is not an IPv6 address"):
        split_host_port("[robot]:0", lowest_port=0)
