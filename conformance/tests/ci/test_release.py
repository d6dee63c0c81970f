"""What a release promises: a light installation, extras by name, completion, licences, commit."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from documented_commands import hide_extras
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from wording import ROOT

from scaraspec.cli.main import COMMANDS

_TIMEOUT_S = 60
_COMPLAINT = str(ROOT / "fixtures/captures/field/complaint-1.pcapng")


@pytest.fixture
def light(tmp_path: Path) -> dict[str, str]:
    """The environment of processes that have no module of an extra."""
    hide_extras(tmp_path)
    path = f"{tmp_path}:{ROOT / 'conformance'}:{ROOT / 'recorder'}"
    return os.environ | {"PYTHONPATH": path, "SCARASPEC_STATE": str(tmp_path / "state")}


def run(
    *arguments: str, environment: dict[str, str], folder: Path
) -> subprocess.CompletedProcess[str]:
    """Run `scaraspec` in an environment."""
    return subprocess.run(
        [sys.executable, "-m", "scaraspec", *arguments],
        env=environment,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=_TIMEOUT_S,
        check=False,
    )


def test_a_light_installation_certifies_and_gates(light: dict[str, str], tmp_path: Path) -> None:
    controller = subprocess.Popen(
        [
            *(sys.executable, "-m", "scaraspec", "controller"),
            *("--listen", "127.0.0.1:0"),
        ],
        env=light,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert controller.stdout
    try:
        url = controller.stdout.readline().split()[-1]
        lines = (
            ("certify", "controller", url, "--only", "4.8", "--out", "run"),
            ("gate", "run", "--baseline", "baseline.json", "--update"),
            ("gate", "run", "--baseline", "baseline.json"),
            ("audit", "run/capture.mcap"),
            ("recover", "run/capture.mcap"),
        )
        for line in lines:
            done = run(*line, environment=light, folder=tmp_path)
            assert (done.returncode, done.stderr) == (0, ""), (line, done.stdout)
    finally:
        controller.terminate()
        controller.communicate()
    refused = run("verify", "run/results.json", environment=light, folder=tmp_path)
    assert refused.returncode == 2
    assert "extra" not in refused.stderr


@pytest.mark.parametrize(
    ("arguments", "extra"),
    [
        (("audit", _COMPLAINT), "pcap"),
        (("convert", _COMPLAINT, "a.mcap"), "pcap"),
        (("view", _COMPLAINT), "view"),
        (("call", "serial:///dev/ttyS9", "get_version"), "serial"),
        (("record", "tcp://127.0.0.1:9", "--metrics", "127.0.0.1:0"), "metrics"),
        (("archive", "query", "archive", "SELECT 1"), "archive"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_a_missing_extra_is_one_sentence(
    light: dict[str, str], tmp_path: Path, arguments: tuple[str, ...], extra: str
) -> None:
    done = run(*arguments, environment=light, folder=tmp_path)
    assert done.returncode in (2, 3)
    assert done.stderr.startswith("scaraspec: ")
    assert done.stderr.count("\n") == 1
    assert f"pip install 'scaraspec[{extra}]'" in done.stderr


def test_a_folder_of_wheels_is_for_one_machine(tmp_path: Path) -> None:
    """Wheels for another Python, or an older scaraspec, are neither mixed in nor removed."""
    (tmp_path / "old.whl").touch()
    script = (sys.executable, f"{ROOT / 'release/wheelhouse.py'}")
    done = subprocess.run(
        [*script, "scaraspec.whl", "--platform", "linux", "--out", f"{tmp_path}"],
        capture_output=True,
        text=True,
        timeout=_TIMEOUT_S,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr == f"{tmp_path} has wheels already: remove it, or choose another folder\n"
    assert [file.name for file in tmp_path.iterdir()] == ["old.whl"]


def test_a_folder_of_wheels_without_extras() -> None:
    """`make wheelhouse EXTRAS=`, and folders for other machines stay in `dist`."""
    commands = subprocess.run(
        ["make", "--dry-run", "wheelhouse", "EXTRAS="],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=_TIMEOUT_S,
        check=True,
    ).stdout
    assert '--extras ""' in commands
    assert re.findall("^rm .*", commands, re.MULTILINE) == ["rm -f dist/scaraspec-*"]


def test_completion_of_commands_imports_none(tmp_path: Path) -> None:
    """A shell completes names without the time that the commands need to start."""
    script = (
        "import atexit, sys\n"
        "atexit.register(lambda: print(*sys.modules, file=sys.stderr))\n"
        "from scaraspec.cli import main\nmain()"
    )
    asked = {"_SCARASPEC_COMPLETE": "bash_complete", "COMP_WORDS": "scaraspec ", "COMP_CWORD": "1"}
    (tmp_path / "scaraspec").write_text(script)
    done = subprocess.run(
        [sys.executable, str(tmp_path / "scaraspec")],
        env=os.environ | asked,
        capture_output=True,
        text=True,
        timeout=_TIMEOUT_S,
        check=True,
    )
    assert [line.partition(",")[2] for line in done.stdout.splitlines()] == list(COMMANDS)
    loaded = set(done.stderr.split())
    assert "scaraspec.cli.main" in loaded
    assert not loaded & {f"scaraspec.cli.{name.replace('-', '_')}" for name in COMMANDS}


def test_the_version_has_the_commit_of_the_checkout(tmp_path: Path) -> None:
    shown = run("--version", environment=dict(os.environ), folder=tmp_path).stdout
    pattern = r"scaraspec, version \d+\.\d+\.\d+(?P<commit> \(commit [0-9a-f]{12}(-dirty)?\))?\n"
    found = re.fullmatch(pattern, shown)
    assert found
    assert bool(found["commit"]) == (ROOT / ".git").exists()
    without_git = os.environ | {"PATH": str(tmp_path)}
    done = run("--version", environment=without_git, folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "commit" not in done.stdout


def test_the_index_page_has_no_relative_link() -> None:
    """An index page has no other files of the repository."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    page = (ROOT / project["readme"]).read_text("utf-8")
    assert re.findall(r"\]\((?!https?://)", page) == []
    assert "<img" not in page


def test_the_licences_of_all_packages_are_listed() -> None:
    rows = dict(
        re.findall(
            r"^\| ([\w-]+) \| .+ \| (.+) \|$",
            (ROOT / "docs/licences.md").read_text("utf-8"),
            re.MULTILINE,
        )
    )
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    named = [
        canonicalize_name(Requirement(text).name)
        for group in (project["dependencies"], *project["optional-dependencies"].values())
        for text in group
    ]
    assert {name for name in named if name not in rows} == {"scaraspec"}
    assert "`pcap`" in rows["scapy"]
    assert "every installation" not in rows["scapy"]
