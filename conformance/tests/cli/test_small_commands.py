"""`scaraspec requirements`, `program` and `frame` on the command line."""

import json
import struct
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from scaraspec.cli.main import COMMANDS, group, main


def run(*arguments: str) -> Result:
    """Run the command with these arguments."""
    return CliRunner().invoke(group, list(arguments))


def test_help_lists_every_command() -> None:
    """`--help` names every command, and every command has a help with an example."""
    listed = run("--help").output
    for name in COMMANDS:
        assert name in listed
        shown = run(name, "--help")
        assert shown.exit_code == 0, shown.output
        assert "scaraspec" in shown.output.partition("Example:")[2], name


def test_requirements_of_a_clause() -> None:
    """A clause or an id selects; 4.1 does not select 4.15."""
    shown = run("requirements", "--clause", "4.1,3/31")
    assert "4.1/1" in shown.output
    assert "4.15/1" not in shown.output
    assert shown.output.endswith("9 of 402 requirements\n")


def test_requirements_as_json() -> None:
    """JSON contains the document's words and our sentence."""
    (entry,) = json.loads(run("requirements", "--clause", "4.8/3", "--json").output)
    assert entry["strength"] == "firm"
    assert "空闲" in entry["original"]
    assert entry["coverage"]["capture"] > 0
    assert entry["coverage"]["controller"]


def test_unknown_clause(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An unknown clause is one sentence and exit status 2."""
    monkeypatch.setattr("sys.argv", ["scaraspec", "requirements", "--clause", "4.99"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    printed = capsys.readouterr().err
    assert printed.startswith("scaraspec: --clause: ")
    assert printed.count("\n") == 1


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("call --timeout nan tcp://127.0.0.1:1 get_status", "is not a number"),
        ("controller --time-scale nan", "is not a number"),
        ("replay CAPTURE nowhere", "is not a link URL"),
        ("audit CAPTURE --html CAPTURE", "exists and is no earlier report of this kind"),
        ("audit CAPTURE --json FOLDER", "FOLDER exists and is no earlier report of this kind"),
        ("audit CAPTURE --json /dev/null", "/dev/null exists and is no earlier report"),
        ("cases --html CAPTURE", "exists and is no earlier report of this kind"),
        ("demo --out CAPTURE", "is not a folder"),
        ("record tcp://127.0.0.1:1 --listen 127.0.0.1:0 --out CAPTURE", "is not a folder"),
    ],
)
def test_wrong_use(  # noqa: PLR0913 - each is a fixture or a parameter
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    fixtures_dir: Path,
    *,
    line: str,
    message: str,
) -> None:
    """Wrong use is reported in one sentence, with exit status 2, and changes no file."""
    capture = tmp_path / "c.pcapng"
    capture.write_bytes((fixtures_dir / "captures/field/complaint-1.pcapng").read_bytes())
    before = capture.read_bytes()
    words = {"CAPTURE": f"{capture}", "FOLDER": f"{tmp_path}"}
    arguments = ["scaraspec", *(words.get(word, word) for word in line.split())]
    monkeypatch.setattr("sys.argv", arguments)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert message.replace("FOLDER", f"{tmp_path}") in capsys.readouterr().err
    assert capture.read_bytes() == before


@pytest.mark.parametrize("kept_bytes", [3, 24])
def test_hostile_file_name(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    kept_bytes: int,
) -> None:
    """Control characters in a file name are escaped, for an empty capture and for another file."""
    capture = tmp_path / "\x1b]0;x\x07.pcap"
    head = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    capture.write_bytes(head[:kept_bytes])
    monkeypatch.setattr("sys.argv", ["scaraspec", "audit", str(capture)])
    with pytest.raises(SystemExit):
        main()
    printed = capsys.readouterr()
    assert "⟨U+001B⟩]0;x⟨U+0007⟩.pcap" in printed.err
    assert "\x1b" not in printed.out + printed.err


def test_program_show(fixtures_dir: Path) -> None:
    """The listing equals the file beside the sample."""
    sample = fixtures_dir / "programs" / "pick-and-place.rob"
    shown = run("program", "show", str(sample))
    assert shown.output == sample.with_suffix(".lst").read_text(encoding="utf-8")


def test_program_check(fixtures_dir: Path) -> None:
    """A valid program has status 0, a damaged one has status 1 and messages with codes."""
    programs = fixtures_dir / "programs"
    assert run("program", "check", str(programs / "pick-and-place.rob")).exit_code == 0
    for damaged in (programs / "damaged").glob("*.rob"):
        checked = run("program", "check", str(damaged))
        only_warned = damaged.stem == "surplus"  # bytes after the footer (6.6b/2)
        assert checked.exit_code == (0 if only_warned else 1), damaged
        assert ("warning P-" if only_warned else "error P-") in checked.output


def test_program_convert(fixtures_dir: Path, tmp_path: Path) -> None:
    """A file converted to another layout has the same listing; an existing target is kept."""
    source, target = fixtures_dir / "programs" / "pick-and-place.rob", tmp_path / "new.rob"
    arguments = ("program", "convert", str(source), str(target), "--layout", "packed-big")
    assert run(*arguments).exit_code == 0
    assert run("program", "show", str(target)).output == run("program", "show", str(source)).output
    before = target.read_bytes()
    assert "exists" in str(run(*arguments).exception)
    assert target.read_bytes() == before


def test_frame() -> None:
    """Frames are explained; an invalid frame gives status 1."""
    assert run("frame", "AA0900CC", "CC09023030AA").exit_code == 0
    wrong = run("frame", "CC0424" + b"1 2 3".hex())
    assert wrong.exit_code == 1
    assert "truncated" in wrong.output
    assert "not hexadecimal" in str(run("frame", "xyz").exception)
    assert "no bytes" in str(run("frame", "").exception)
