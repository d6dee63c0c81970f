"""The layer for scapy decodes and builds the frames that our codec decodes and builds."""

import json
import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scapy.layers.inet import IP, TCP
from scapy.packet import Packet
from scapy.sessions import TCPSession
from scapy.utils import rdpcap
from wording import ROOT

from scaraspec.dissectors.scapy_layer import PACKETS, UISR, InvalidBytes
from scaraspec.protocol.commands import BY_NAME, COMMANDS, parse_frame
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.frames import Frame
from scaraspec.suite.engine import strategies

FIELD_CAPTURES = ROOT / "fixtures/captures/field"
DOCUMENTED = ROOT / "fixtures/frames/documented.jsonl"


def layers(packet: Packet) -> list[Packet]:
    """The layers of this protocol in a packet."""
    found = [packet.getlayer(number) for number in range(1, 100)]
    return [layer for layer in found if isinstance(layer, UISR | InvalidBytes)]


def data_of(packet: Packet) -> bytes:
    """The data in the bytes of a frame."""
    raw = bytes(packet)
    return raw[4 if packet.tag else 3 : -1]


@pytest.mark.parametrize(("name", "part"), PACKETS, ids=map(" ".join, PACKETS))
@given(drawn=st.data())
@settings(max_examples=5, database=None, derandomize=True)
def test_every_message(name: str, part: str, drawn: st.DataObject) -> None:
    """Each message is decoded into its values, and built from them again."""
    command = BY_NAME[name]
    payload = getattr(command, part)
    sender = command.initiator if part == "request" else command.initiator.opposite
    value = drawn.draw(strategies.payload_values(payload))
    sent = Frame(sender, command.opcode, payload.encode(value), part == "result").encode()
    packet = UISR(sent)
    assert type(packet) is PACKETS[name, part]
    assert (packet.row, packet.part) == (command, part)
    values = {key: item for key, item in packet.fields.items() if key not in UISR().fields}
    assert bytes(PACKETS[name, part](**values)) == sent


def test_no_message_is_missing() -> None:
    """Every message of the command table has a class."""
    parts = {
        (command.name, part)
        for command in COMMANDS
        for part in ("request", "reply", "result")
        if getattr(command, part) is not None
    }
    assert set(PACKETS) == parts


def test_documented_frames() -> None:
    """The frames of the document have the values of our decoder."""
    for line in DOCUMENTED.read_text("utf-8").splitlines():
        row = json.loads(line)
        raw = bytes.fromhex(row["frame_hex"])
        packet = UISR(raw)
        frame = Frame(A2C if raw[0] == 0xAA else C2A, packet.opcode, data_of(packet), row["tagged"])
        parsed = parse_frame(frame)
        assert bytes(packet) == raw
        assert parsed is not None
        assert (packet.row, packet.part) == (parsed.command, parsed.part)


@given(st.binary(max_size=80) | st.binary(max_size=20).map(lambda data: b"\xaa\x09\x00\xcc" + data))
@settings(max_examples=100, database=None, derandomize=True)
def test_any_bytes(data: bytes) -> None:
    """Any bytes are dissected without an error, and built again as they were."""
    assert bytes(UISR(data)) == data or not data


def test_segment() -> None:
    """A segment may have several frames, invalid bytes, and an undefined opcode."""
    raw = bytes.fromhex("CC09023030AA 0102 CC9030023131AA CC770178AA")
    packet = IP(bytes(IP() / TCP(sport=8877, dport=50000) / raw))
    assert UISR in packet
    found = layers(packet)
    assert [layer.name for layer in found] == [
        "UISR get_status reply",
        "UISR invalid bytes",
        "UISR run_program result",
        "UISR",
    ]
    assert (found[0].code, found[2].done, found[3].data) == ("00", True, b"x")
    assert bytes(packet[TCP].payload) == raw


def test_changed_value() -> None:
    """Length and data follow a value that is changed."""
    packet = UISR(bytes.fromhex("AA30017ACC"))
    packet.name_ = b"pick.rob"
    assert bytes(packet) == b"\xaa\x30\x08pick.rob\xcc"
    packet.length = 3
    assert bytes(packet) == b"\xaa\x30\x03pick.rob\xcc"
    assert (IP() / TCP() / packet)[TCP].dport == 8877


def test_impossible_value() -> None:
    """A value that the document forbids cannot be built; raw data can."""
    move = PACKETS["set_digital_output", "request"](port=41, value=1)
    with pytest.raises(PayloadError):
        bytes(move)
    move.data = b"41|1"
    assert bytes(move) == b"\xaa\x43\x0441|1\xcc"


def test_passwords() -> None:
    """scapy prints no password, whether the frame is valid or not."""
    shown = "".join(
        f"{UISR(bytes.fromhex(digits)).show(dump=True)}"
        for digits in (
            "AA010473657372CC",
            "AA010473657372CCCC",
            "AA0104736573720000",
            "AA010573657C7372CC",
        )
    )
    assert "ses" not in shown
    assert "(password)" in shown


@pytest.mark.parametrize(
    "path", sorted(FIELD_CAPTURES.glob("plant-*.pcapng")), ids=lambda path: path.stem
)
def test_captures(path: Path) -> None:
    """Every byte of a capture is built again; split frames are joined."""
    for packet in rdpcap(f"{path}"):
        original = bytes(packet[TCP].payload.original or b"")
        assert bytes(packet[TCP].payload) == original


def test_split_frames() -> None:
    """A session joins frames that are split over segments."""
    session = TCPSession()
    packets = rdpcap(f"{FIELD_CAPTURES / 'plant-c-serial-bridge-bytewise.pcapng'}")
    joined = [out for packet in packets if (out := session.process(packet)) and UISR in out]
    assert sum(len(layers(packet)) for packet in joined) == 77


def test_example(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The example of the documentation runs."""
    page = (ROOT / "docs/wireshark.md").read_text("utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    capture = FIELD_CAPTURES / "plant-c-serial-bridge-bytewise.pcapng"
    (tmp_path / "field.pcapng").write_bytes(capture.read_bytes())
    monkeypatch.chdir(tmp_path)
    exec(example, {})
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 77
    assert "get_status reply" in lines[5]
