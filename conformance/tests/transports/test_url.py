"""Link URLs: what they name, and one clear sentence where they name nothing."""

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
def test_a_url_names_a_link_and_is_written_again(url: str, address: Tcp | Serial | Rfcomm) -> None:
    """Each scheme has its default; what was read is written in a form that reads the same."""
    assert parse(url) == address
    if url != "serial:///dev/a%20b":
        assert parse(str(address)) == address


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("", "is no link: write for example tcp://"),
        ("192.168.1.2:8877", "is no link"),
        ("robot", "is no link"),
        ("http://robot", "is no link"),
        ("tcp://", "names no host"),
        ("tcp://:8877", "names no host"),
        ("tcp://robot:", "no port: it is a number from 1 to 65535"),
        ("tcp://robot:0", "no port"),
        ("tcp://robot:65536", "no port"),
        ("tcp://robot:٣", "no port"),
        ("tcp://robot:" + "9" * 5000, "no port"),
        ("tcp://::1:8877", "write an IPv6 address as [::1:8877]:8877"),
        ("tcp://[robot]:8877", "is no link"),
        ("tcp://[::1", "is no link"),
        ("tcp://[::1]8877", "names no host"),
        ("tcp://user@robot", "is no link"),
        ("tcp://robot/path", "is no link"),
        ("tcp://robot?baud=1", "is no link"),
        ("tcp://robot#a", "is no link"),
        ("tcp://ro bot", "names no host"),
        ("tcp://robot\n", "is no link"),
        ("serial://", "is no link"),
        ("serial:///dev/x?baud=fast", "no baud rate"),
        ("serial:///dev/x?baud=0", "no baud rate"),
        ("serial:///dev/x?speed=9600", "no setting of a serial link: write ?baud=115200"),
        ("serial:///dev/x?baud=1&baud=2", "no setting"),
        ("rfcomm://AA:BB:CC:DD:EE/1", "is no link"),
        ("rfcomm://AA:BB:CC:DD:EE:FF/31", "no RFCOMM channel: it is a number from 1 to 30"),
        ("rfcomm://AA:BB:CC:DD:EE:FF/x", "no RFCOMM channel"),
    ],
)
def test_a_wrong_url_is_told_in_one_sentence(url: str, said: str) -> None:
    """What is wrong, and what would be right."""
    with pytest.raises(UrlError) as told:
        parse(url)
    assert said in str(told.value)
    assert "\n" not in str(told.value)


@given(url=st.text(max_size=60) | st.text(max_size=40).map("tcp://".__add__))
def test_any_text_is_a_link_or_told(url: str) -> None:
    """No text makes anything else than an address or a `UrlError`."""
    try:
        address = parse(url)
    except UrlError:
        return
    assert address


def test_host_and_port_may_have_port_0_where_one_listens() -> None:
    """0 is any port for a listener."""
    assert split_host_port("127.0.0.1:0", lowest_port=0) == ("127.0.0.1", 0)
    assert join_host_port("::1", 5) == "[::1]:5"
    with pytest.raises(UrlError, match="'robot' is no IPv6 address"):
        split_host_port("[robot]:0", lowest_port=0)
