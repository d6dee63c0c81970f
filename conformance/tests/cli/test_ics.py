"""`scaraspec ics`: a proforma with all questions, and the check of an ICS."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from scaraspec.cli.main import group
from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.engine.ics import Ics


def run(*arguments: str) -> Result:
    """Run the command with these arguments."""
    return CliRunner().invoke(group, ["ics", *arguments])


def test_unfilled(tmp_path: Path) -> None:
    """Without a URL no question is answered, and the ICS is valid."""
    path = tmp_path / "ics.toml"
    assert run("new", "--out", str(path)).output == f"{path}\n"
    assert Ics.read(path) == Ics()
    assert run("new").output == path.read_text("utf-8")
    assert run("check", str(path)).output == f"{path}: no contradiction\n"


def test_an_existing_file_is_not_overwritten(refused: Callable[..., str], tmp_path: Path) -> None:
    """An existing file is not changed."""
    path = tmp_path / "ics.toml"
    path.write_text("mine")
    assert "exists: name a new file" in refused("ics", "new", "--out", str(path))
    assert path.read_text() == "mine"


def test_a_file_that_cannot_be_written(processes: Any, tmp_path: Path) -> None:
    """Exit status 3, and one sentence."""
    ended = processes.run("ics", "new", "--out", str(tmp_path / "none" / "ics.toml"))
    assert ended.returncode == 3
    assert "cannot be written" in ended.stderr


def test_filled_in_by_queries(processes: Any, relay: Callable[..., Any], tmp_path: Path) -> None:
    """The ICS has the claims that queries show; only logins and queries are sent."""
    path = tmp_path / "ics.toml"
    upstream = processes.controller("--reading", "op_get_default=0x13")
    sent: list[bytearray] = []

    def watch(send: Callable[[bytes], None]) -> Callable[[bytes], None]:
        kept = bytearray()
        sent.append(kept)

        def take(data: bytes) -> None:
            kept.extend(data)
            send(data)

        return take

    with relay(upstream, watch) as one:
        url = "tcp://{}:{}".format(*one.address)
        ended = processes.run("ics", "new", url, "--out", str(path))
        assert ended.returncode == 0, ended.stderr
    opcodes = {
        item.opcode
        for kept in sent
        for item in Framer(A2C).feed(bytes(kept))
        if isinstance(item, Frame)
    }
    assert len(opcodes) > 10
    for opcode in opcodes:
        command = BY_OPCODE[opcode]
        assert command.name == "login" or command.hazard is Hazard.READ_ONLY
    ics = Ics.read(path)
    assert (ics.url, ics.version) == (url, "1.0.0")
    assert (ics.dialect["op_get_default"], ics.dialect["max_clients"]) == ("0x13", "many")
    assert {"op_get_default", "max_clients", "op_temp_reply"} <= ics.claimed


def test_claims_are_verified(processes: Any, tmp_path: Path) -> None:
    """A right claim is confirmed; a wrong claim or a served command in `lacks` gives status 1.

    A violation that concerns no claim, such as a version without data, is no mistake in the ICS.
    """
    url = "tcp://{}:{}".format(*processes.controller("--mutant", "no-version"))
    path = tmp_path / "ics.toml"
    path.write_text('[readings]\nruninfo_none = "0"\nendian = "little"\n')
    ended = processes.run("ics", "check", str(path), url)
    assert ended.returncode == 0, ended.stderr
    assert "verified: runinfo_none\n" in ended.stdout
    assert "not visible in queries, so `certify` verifies it: endian\n" in ended.stdout
    path.write_text('[subject]\nlacks = ["get_version"]\n[readings]\nruninfo_none = "0||"\n')
    ended = processes.run("ics", "check", str(path), url)
    assert ended.returncode == 1
    assert "the ICS claims runinfo_none = 0||" in ended.stdout
    assert "expected 0||, observed 0\n" in ended.stdout
    assert "get_version is unsupported, but it is answered" in ended.stdout


@pytest.mark.parametrize("command", [["new"], ["check", "ics.toml"]])
def test_no_answer(
    processes: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: list[str]
) -> None:
    """Exit status 3 if the controller does not answer."""
    monkeypatch.chdir(tmp_path)
    Path("ics.toml").write_text("")
    ended = processes.run("ics", *command, "tcp://127.0.0.1:1")
    assert (ended.returncode, ended.stderr.count("\n")) == (3, 1), ended.stderr
    assert "could not be used at the start of the run" in ended.stderr


def test_files_and_links_that_cannot_be_used(refused: Callable[..., str], tmp_path: Path) -> None:
    """Exit status 2."""
    path = tmp_path / "ics.toml"
    assert "cannot be read" in refused("ics", "check", str(path))
    for text in ("[", "a = " + "[" * 5000):
        path.write_text(text)
        assert "is not valid TOML" in refused("ics", "check", str(path))
    path.write_text("")
    assert "x://" in refused("ics", "check", str(path), "x://robot")
    assert "x://" in refused("ics", "new", "x://robot")


def test_mistakes_are_listed(tmp_path: Path) -> None:
    """Each mistake has a message, and all are listed."""
    path = tmp_path / "ics.toml"
    path.write_text(
        '[subject]\nnmae = "x"\nlacks = ["fly"]\n[readings]\nendian = "left"\n'
        '[sample]\nserial = "1"\n'
    )
    ended = run("check", str(path))
    assert ended.exit_code == 1
    for line, reported in zip(
        ended.output.splitlines(),
        ("subject.nmae is not known", "'fly'", "endian cannot be", "sample.serial is not known"),
        strict=True,
    ):
        assert reported in line
