"""The dissector in tshark decodes every frame like our decoder.

Needs tshark; run by `make test-wireshark`. Each capture is read as tshark and Wireshark read it: in
one and in two passes, and with and without waiting for segments that are out of order.
"""

import json
import random
import struct
import subprocess
from collections import Counter
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path
from typing import Final, NamedTuple
from xml.etree import ElementTree as ET

import pytest
from wording import ROOT

from scaraspec.api.captures import open_capture
from scaraspec.dissectors import wireshark
from scaraspec.protocol import program_files
from scaraspec.protocol.commands import COMMANDS
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.redaction import is_secret
from scaraspec.protocol.transfer import FILE_DATA, chunks_of
from scaraspec.traffic.events import FrameSeen
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sinks.pcapng_writer import PcapngWriter
from scaraspec_recorder.sinks.text import frame_text, part_of
from scaraspec_recorder.sources.capture import open_capture as open_source

pytestmark = pytest.mark.wireshark

CAPTURES: Final = sorted(
    path for path in (ROOT / "fixtures/captures").glob("*/*.pcap*") if path.stat().st_size
)
DOCUMENTED: Final = ROOT / "fixtures/frames/documented.jsonl"
PROGRAM: Final = next((ROOT / "fixtures/programs").glob("**/*.rob"))
OUT_OF_ORDER: Final = ("-o", "tcp.reassemble_out_of_order:TRUE")
START_NS: Final = 1_795_215_517_000_000_000
SEED: Final = 20261126


class Decoded(NamedTuple):
    """What a decoder finds in a frame."""

    sender: Direction
    position: int
    opcode: int
    tagged: bool
    command: str
    part: str
    text: str
    data: bytes | None
    defects: tuple[str, ...]
    readings: tuple[str, ...]


Connections = dict[str, set[Decoded]]


@pytest.fixture(scope="module")
def lua(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dissector as a file."""
    path = tmp_path_factory.mktemp("lua") / "uisr.lua"
    path.write_text(wireshark.render(), "utf-8")
    return path


def run_tshark(lua: Path, *arguments: str) -> bytes:
    """Return the output of tshark; an error in Lua fails."""
    command = ["tshark", "-X", f"lua_script:{lua}", *arguments]
    done = subprocess.run(command, capture_output=True, check=True)
    assert b"Lua" not in done.stderr, done.stderr.decode()
    assert b"Lua Error" not in done.stdout
    return done.stdout


def read_with_tshark(lua: Path, capture: Path, *options: str) -> Connections:
    """Return what the dissector finds in each TCP stream."""
    arguments = ("-T", "pdml", "-J", "tcp uisr", *options)
    found: Connections = {}
    for packet in ET.fromstring(run_tshark(lua, "-r", f"{capture}", *arguments)).iter("packet"):
        streams = [
            field.get("show", "")
            for field in packet.iter("field")
            if field.get("name") == "tcp.stream"
        ]
        for frame in packet.iter("proto"):
            shown: dict[str, list[ET.Element]] = {}
            for field in frame:
                shown.setdefault(field.get("name", ""), []).append(field)
            if "uisr.opcode" in shown:
                found.setdefault(streams[-1], set()).add(_decoded(shown))
    return found


def _decoded(shown: dict[str, list[ET.Element]]) -> Decoded:
    def all_of(name: str) -> tuple[str, ...]:
        return tuple(field.get("show", "") for field in shown.get(name, ()))

    def one(name: str) -> str:
        return next(iter(all_of(name)), "")

    return Decoded(
        sender=A2C if one("uisr.sender") == "client" else C2A,
        position=int(one("uisr.position")),
        opcode=int(one("uisr.opcode"), 16),
        tagged="uisr.tag" in shown,
        command=one("uisr.command"),
        part=one("uisr.part"),
        text=one("uisr.text"),
        data=bytes.fromhex(one("uisr.data").replace(":", "")),
        defects=all_of("uisr.defect"),
        readings=all_of("uisr.reading"),
    )


def read_with_ours(capture: Path) -> Connections:
    """Return what our decoder finds in each connection."""
    found: Connections = {}
    for step in open_capture(capture, port=8877).steps():
        seen = step.event
        if isinstance(seen, FrameSeen):
            decoded = seen.parsed.decoded if seen.parsed else None
            found.setdefault(seen.place.connection, set()).add(
                Decoded(
                    sender=seen.place.direction,
                    position=seen.place.offset_bytes,
                    opcode=seen.frame.opcode,
                    tagged=seen.frame.tagged,
                    command=seen.name,
                    part=part_of(seen),
                    text=frame_text(seen),
                    data=b"" if is_secret(seen.frame) else seen.frame.data,
                    defects=tuple(i.defect.value for i in decoded.issues) if decoded else (),
                    readings=tuple(map("=".join, decoded.readings)) if decoded else (),
                )
            )
    return found


def assert_equal(tshark: Connections, ours: Connections) -> None:
    """Both have the same frames in the same connections."""
    assert Counter(map(frozenset, tshark.values())) == Counter(map(frozenset, ours.values()))


def write_capture(
    path: Path, pieces: Iterable[tuple[Direction, bytes]], step_ns: int = 1_000_000
) -> Path:
    """Write a capture of one connection, with one packet for each piece."""
    offsets = {A2C: 0, C2A: 0}
    note = "192.0.2.20:51234 > 192.0.2.7:8877"
    with path.open("wb") as file:
        writer = PcapngWriter(file)
        writer.write(WireEvent(START_NS, "1", A2C, Kind.OPENED, note=note))
        for number, (sender, data) in enumerate(pieces, start=1):
            time_ns = START_NS + number * step_ns
            writer.write(WireEvent(time_ns, "1", sender, Kind.BYTES, data, offsets[sender]))
            offsets[sender] += len(data)
    return path


@pytest.mark.parametrize("capture", CAPTURES, ids=lambda path: path.stem)
def test_captures(capture: Path, lua: Path) -> None:
    """Each capture has the same frames, fields and positions.

    tshark omits frames in retransmitted packets, or those after a loss, depending on an option.
    """
    found: Connections = {}
    for order in ((), OUT_OF_ORDER):
        in_one_pass = read_with_tshark(lua, capture, *order)
        assert read_with_tshark(lua, capture, "-2", *order) == in_one_pass
        for stream, frames in in_one_pass.items():
            found.setdefault(stream, set()).update(frames)
    assert_equal(found, read_with_ours(capture))


@pytest.mark.parametrize("name", ["lz4-compressed", "sequence-always-zero", "one-flipped-bit"])
def test_recordings(name: str, lua: Path, tmp_path: Path) -> None:
    """Recordings have the same frames after their conversion; one is on another port."""
    recording = ROOT / f"fixtures/captures/cases/{name}.mcap"
    converted = tmp_path / "converted.pcapng"
    with converted.open("wb") as file:
        writer = PcapngWriter(file)
        for event in open_source(recording, port=None):
            writer.write(event)
    found = read_with_tshark(lua, converted, "-d", "tcp.port==9000,uisr")
    assert_equal(found, read_with_ours(recording))


def test_documented_frames(lua: Path, tmp_path: Path) -> None:
    """The frames that the document prints, and what they would be with the printed lengths."""
    rows = [json.loads(line) for line in DOCUMENTED.read_text("utf-8").splitlines()]
    pieces = []
    for row in rows:
        sender, raw = Direction(row["direction"]), bytes.fromhex(row["frame_hex"])
        copied = bytearray(raw)
        if isinstance(row["declared_length"], int):
            copied[3 if row["tagged"] else 2] = row["declared_length"]
        pieces += [(sender, raw), (sender, bytes(copied)), (sender, raw)]
    capture = write_capture(tmp_path / "documented.pcapng", pieces)
    assert_equal(read_with_tshark(lua, capture), read_with_ours(capture))


def unusual_frames(number: int) -> Iterable[Frame]:
    """Yield frames with data that deviates from the document, for every command."""
    draw = random.Random(SEED)
    parts = [
        b"|",
        b" ",
        b"",
        b"0",
        b"1",
        b"00",
        b"11",
        b"20",
        b"1a",
        b"07",
        b"-0.0",
        b"-17.50",
        b"007",
    ]
    parts += [
        "程序".encode(),
        "程序".encode("gb18030"),
        "𠀀".encode("gb18030"),
        b"\xff\x80",
        b"\0",
        b'"',
    ]
    parts += [
        b"192.168.001.7",
        b"256.1.1.1",
        b"20260229101112",
        b"20240229101112",
        b"00235959",
        b"00246060",
    ]
    parts += [
        b"1.2.3",
        b"a/b.rob",
        b"..",
        b"10000000",
        b"x" * 40,
        "“".encode(),
        "”".encode(),
        "\u3000é\u200b".encode(),
    ]
    parts += [
        b"99999999999999999999",
        b"3000000000",
        b"0|pro1.rob|pro1.rob|",
        b"1|a|b",
        b"\1",
        b"\3",
        b"\x07",
    ]
    for _ in range(number):
        command = draw.choice(COMMANDS)
        data = b"|".join(
            b"".join(draw.choices(parts, k=draw.randint(1, 2)))
            for _ in range(draw.choice([1, 1, 2, 3, 4, 6, 7]))
        )
        if command.name.endswith("_chunk") and draw.random() < 0.7:
            numbers = [draw.choice([0, 1, 40, 200, 201, 400, 2**24, 2**31]) for _ in range(3)]
            order = draw.choice("<>")
            data = struct.pack(f"{order}3I", *numbers) + bytes(draw.choice([0, 40, 200]))
        tagged = draw.random() < 0.3
        sender = C2A if tagged else draw.choice([A2C, C2A])
        yield Frame(sender, draw.choice([command.opcode, 0x0E]), data[:255], tagged)


def test_unusual_data(lua: Path, tmp_path: Path) -> None:
    """Texts, defects and readings of data that deviates from the document are the same."""
    frames = [(frame.direction, frame.encode()) for frame in unusual_frames(3000)]
    capture = write_capture(tmp_path / "unusual.pcapng", frames)
    assert_equal(read_with_tshark(lua, capture), read_with_ours(capture))


def spoilt_streams(number: int) -> Iterable[tuple[Direction, bytes]]:
    """Yield pieces of both directions: frames that are cut, changed or joined, and random bytes."""
    draw = random.Random(SEED)
    for frame in unusual_frames(number):
        data = bytearray(frame.encode())
        kind = draw.randrange(6)
        if kind == 0:
            data[draw.randrange(len(data))] = draw.choice([0xAA, 0xCC, 0x90, draw.randrange(256)])
        elif kind == 1:
            del data[draw.randrange(len(data)) :]
        elif kind == 2:
            data += draw.randbytes(draw.randrange(6))
        cut = draw.randint(0, len(data))
        yield from ((frame.direction, bytes(part)) for part in (data[:cut], data[cut:]) if part)


@pytest.mark.parametrize("step_ns", [1_000_000, 1_100_000_000], ids=["fast", "with-silences"])
def test_spoilt_streams(step_ns: int, lua: Path, tmp_path: Path) -> None:
    """The same frames are found after invalid bytes and silences, without an error in Lua."""
    pieces = [*spoilt_streams(600)]
    pieces += [(sender, bytes(300)) for sender in (A2C, C2A)]  # ends an unfinished frame
    capture = write_capture(tmp_path / "spoilt.pcapng", pieces, step_ns)
    ours = read_with_ours(capture)
    assert_equal(read_with_tshark(lua, capture), ours)
    assert_equal(read_with_tshark(lua, capture, "-2"), ours)


def test_cut_packets(lua: Path, tmp_path: Path) -> None:
    """Packets that the capture has only in part, and random bytes, cause no Lua error."""
    draw = random.Random(SEED)
    pieces = [*spoilt_streams(300), *((A2C, draw.randbytes(1000)) for _ in range(50))]
    capture = write_capture(tmp_path / "whole.pcapng", pieces)
    cut = tmp_path / "cut.pcapng"
    subprocess.run(["editcap", "-s", "60", capture, cut], check=True)
    assert b"uisr" in run_tshark(lua, "-r", f"{cut}", "-T", "pdml")
    alone = ("-o", "tcp.desegment_tcp_streams:FALSE")
    assert b"uisr" in run_tshark(lua, "-r", f"{capture}", "-T", "pdml", *alone)


def test_programs(lua: Path, tmp_path: Path) -> None:
    """The nodes of a program are shown at its last chunk, in every layout."""
    program = program_files.parse(PROGRAM.read_bytes())
    files = [program_files.build(program, layout) for layout in program_files.LAYOUTS.values()]
    frames = [
        Frame(A2C, 0x52, FILE_DATA.encode(chunk)) for file in files for chunk in chunks_of(file)
    ]
    capture = write_capture(tmp_path / "upload.pcapng", [(A2C, frame.encode()) for frame in frames])
    shown = ET.fromstring(run_tshark(lua, "-r", f"{capture}", "-T", "pdml", "-J", "uisr"))
    found: dict[str, list[str]] = {}
    for field in shown.iter("field"):
        found.setdefault(field.get("name", ""), []).append(field.get("show", ""))
    programs = [program_files.parse(file) for file in files]
    nodes = [node for each in programs for node in each.nodes]
    assert found["uisr.program.layout"] == [program_files.detect(file)[0].name for file in files]
    assert found["uisr.node.type"] == [f"{node.type}" for node in nodes]
    assert found["uisr.node.alias"] == [node.alias.decode() for node in nodes]
    assert found["uisr.node.values"] == [values_text(node) for node in nodes if node.data]
    assert found["uisr.variable.name"] == [
        variable.name.decode() for each in programs for variable in each.variables
    ]


def values_text(node: program_files.Node) -> str:
    """Return the values of a node as the dissector writes them."""
    if isinstance(node.data, program_files.Point):
        return ", ".join(f"value {n} {v:.7g}" for n, v in enumerate(node.data.values, start=1))
    assert node.data is not None
    return ", ".join(f"{each.name} {getattr(node.data, each.name)}" for each in fields(node.data))


def test_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """tshark loads the installed dissector, and knows every field by its filter name."""
    monkeypatch.setenv("HOME", f"{tmp_path}")
    wireshark.install()
    done = subprocess.run(["tshark", "-G", "fields"], capture_output=True, check=True)
    lines = [line.split("\t") for line in done.stdout.decode().splitlines()]
    names = {line[2] for line in lines if line[0] == "F"}
    assert {field.filter for field in wireshark.filter_fields()} <= names


def test_documented_filters(lua: Path) -> None:
    """Every filter in the documentation is valid, and one finds what it promises."""
    page = (ROOT / "docs/wireshark.md").read_text("utf-8")
    rows = [
        line.split("`")[1].replace("\\|", "|") for line in page.splitlines() if line[:3] == "| `"
    ]
    assert len(rows) > 10
    everything = " || ".join(f"({row})" for row in rows)
    capture = f"{ROOT / 'fixtures/captures/field/plant-a-morning-shift.pcapng'}"
    columns = ("-T", "fields", "-e", "uisr.text")
    assert run_tshark(lua, "-r", capture, "-Y", everything, *columns)
    assert run_tshark(lua, "-r", capture, "-Y", rows[2], *columns).count(b"refused") == 7


def test_expert_infos(lua: Path, tmp_path: Path) -> None:
    """What is unusual is an expert info that a filter finds."""
    sent = {
        "opcode": (A2C, "AA 77 00 CC"),
        "stray": (A2C, "00 01"),
        "end": (A2C, "AA 09 00 00 00"),
        "length": (A2C, "AA 54 03 61 62 63 64 65 CC"),
        "tag": (C2A, "CC 90 09 00 AA"),
        "refusal": (C2A, "CC 30 04 30 7C 32 30 AA"),
        "undecodable": (C2A, "CC 09 02 78 78 AA"),
        "defect": (C2A, "CC 09 03 30 30 00 AA"),
    }
    pieces = [(sender, bytes.fromhex(digits)) for sender, digits in sent.values()]
    capture = write_capture(tmp_path / "unusual.pcapng", pieces)
    for name in sent:
        columns = ("-T", "fields", "-e", "uisr.position")
        shown = run_tshark(lua, "-r", f"{capture}", "-Y", f"uisr.expert.{name}", *columns)
        assert len(shown.splitlines()) == 1, name


def test_passwords(lua: Path, tmp_path: Path) -> None:
    """No field of the dissector has a password, whether the frame is whole or not."""
    frames = [
        "AA010470617373CC",
        "AA03097061737377317C6F6BCC",
        "AA0109706173730000CC",
        "CC0104706173730AAA",
    ]
    pieces = [(C2A if f.startswith("CC") else A2C, bytes.fromhex(f)) for f in frames]
    capture = write_capture(tmp_path / "login.pcapng", pieces)
    shown = run_tshark(lua, "-r", f"{capture}", "-V", "-O", "uisr").decode()
    assert "(password)" in shown
    assert "pass" not in shown.replace("(password)", "").replace("set_password", "")
    assert "7061" not in shown
