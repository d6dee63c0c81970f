"""The generated dissector has every command, field and decoder; it is installed with care."""

import re
from pathlib import Path

import pytest

from scaraspec.dissectors import wireshark
from scaraspec.protocol.commands import BY_OPCODE, COMMANDS, Command
from scaraspec.protocol.errors import TABLE_8_1
from scaraspec.protocol.fields import Defect
from scaraspec.protocol.program_files import LAYOUTS, NodeType
from scaraspec.protocol.readings import READINGS


@pytest.fixture(scope="module")
def source() -> str:
    return wireshark.render()


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_commands(command: Command, source: str) -> None:
    """Every command is in the table, under each of its opcodes, with all its fields."""
    for opcode in (number for number, each in BY_OPCODE.items() if each is command):
        assert f'[{opcode}] = {{ name = "{command.name}"' in source
    fields = command.request.fields + command.reply.fields
    for field in fields:
        assert f'filter = "uisr.{command.name}.{field.name}"' in source


def test_filters_are_unique() -> None:
    """No two fields have the same name."""
    filters = [field.filter for field in wireshark.filter_fields()]
    assert len(set(filters)) == len(filters)


def test_codes_layouts_and_nodes(source: str) -> None:
    """Table 8-1, the layouts of program files and the types of nodes are complete."""
    for code in TABLE_8_1.values():
        assert f'["{code.text}"] = "{code.meaning}"' in source
    for layout in LAYOUTS.values():
        assert f'name = "{layout.name}", order = "{layout.byte_order.value}"' in source
    for node in NodeType:
        assert f'name = "{node.name}", forms = ' in source


@pytest.mark.parametrize("family", ["FIELD", "PAYLOAD"])
def test_kinds(family: str, source: str) -> None:
    """Every kind of field and payload in the table has a decoder, and every decoder is used."""
    kinds = set(re.findall(r'{ kind = "(\w+)"', source))
    decoders = {
        each: set(re.findall(rf"^function {each}\.(\w+)", source, re.MULTILINE))
        for each in ("FIELD", "PAYLOAD")
    }
    assert decoders["FIELD"] | decoders["PAYLOAD"] == kinds
    assert decoders[family]


def test_defects_and_readings(source: str) -> None:
    """The decoders name defects and readings as the decoder in Python does."""
    defects = set(re.findall(r'add_defect\(findings, "([^"]+)"\)', source))
    readings = set(re.findall(r'add_reading\(findings, "([^"]+)"', source))
    assert defects == {defect.value for defect in Defect}
    assert readings <= set(READINGS)


def test_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder is made; an older dissector is replaced, another file is not."""
    folder = tmp_path / "wireshark" / "plugins"
    monkeypatch.setattr(wireshark, "wireshark_plugin_directory", lambda: folder)
    path = wireshark.install()
    assert path == folder / "uisr.lua"
    assert path.read_text("utf-8") == wireshark.render()
    path.write_text(f"-- {wireshark.MARKER}: an older version\n")
    wireshark.install()
    assert path.read_text("utf-8") == wireshark.render()
    path.write_text(f"-- a dissector of another team\n-- {wireshark.MARKER}\n")
    with pytest.raises(wireshark.ForeignFileError, match="is not from scaraspec"):
        wireshark.install()
    assert path.read_text("utf-8").startswith("-- a dissector of another team")
