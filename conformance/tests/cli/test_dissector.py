"""`scaraspec dissector`, called as a user calls it."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from scaraspec.cli.main import group
from scaraspec.cli.problems import Problem
from scaraspec.dissectors import wireshark


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where Wireshark would look for plugins."""
    path = tmp_path / "plugins"
    monkeypatch.setattr(wireshark, "wireshark_plugin_directory", lambda: path)
    return path


def test_prints_the_dissector(folder: Path) -> None:
    """Without --install it is printed, and nothing is written."""
    shown = CliRunner().invoke(group, ["dissector", "--wireshark"])
    assert shown.output == wireshark.render()
    assert not folder.exists()


def test_installs_it(folder: Path) -> None:
    """The path is printed."""
    shown = CliRunner().invoke(group, ["dissector", "--wireshark", "--install"])
    assert shown.output == f"{folder / 'uisr.lua'}\n"
    assert (folder / "uisr.lua").is_file()


def test_keeps_another_file(folder: Path) -> None:
    """A file that scaraspec did not write is not replaced."""
    folder.mkdir()
    (folder / "uisr.lua").write_text("-- mine\n")
    shown = CliRunner().invoke(group, ["dissector", "--wireshark", "--install"])
    assert isinstance(shown.exception, Problem)
    assert "uisr.lua is not from scaraspec" in str(shown.exception)


def test_unwritable_folder(folder: Path) -> None:
    """A folder that cannot be made is one sentence."""
    folder.write_text("a file")
    shown = CliRunner().invoke(group, ["dissector", "--wireshark", "--install"])
    assert isinstance(shown.exception, Problem)
    assert "cannot be written" in str(shown.exception)


def test_no_tool() -> None:
    """The tool must be named."""
    assert CliRunner().invoke(group, ["dissector"]).exit_code == 2
