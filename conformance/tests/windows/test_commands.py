"""Each command in a Windows CPython under Wine: what a field engineer does on a laptop."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from certification import certified, list_of_cases, packed

from tests.windows.conftest import Windows, windows_path

pytestmark = pytest.mark.windows

FIXTURES = Path(__file__).parents[3] / "fixtures"
COMPLAINT = windows_path(FIXTURES / "captures/field/complaint-1.pcapng")
PROGRAM = windows_path(FIXTURES / "programs/pick-and-place.rob")


def on_linux(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run `scaraspec` on this system."""
    return subprocess.run(
        [sys.executable, "-m", "scaraspec", *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


@pytest.mark.parametrize(
    "arguments",
    [
        ("audit", COMPLAINT),
        ("exchanges", COMPLAINT),
        ("compare", COMPLAINT, COMPLAINT.replace("complaint-1", "complaint-2")),
        ("frame", "AA0900CC", "CC09023030AA"),
        ("program", "show", PROGRAM),
        ("program", "check", PROGRAM),
        ("requirements", "--entry", "A-3-14"),
        ("cases", "4.17/3"),
        ("certify", "controller", "--help"),
    ],
    ids=" ".join,
)
def test_a_command_prints_the_same_as_on_linux(
    windows: Windows, arguments: tuple[str, ...]
) -> None:
    done = windows.run(*arguments)
    stdout, words = done.stdout, list(arguments)
    for number, word in enumerate(arguments):
        if word.startswith("Z:"):
            words[number] = word.removeprefix("Z:").replace("\\", "/")
            stdout = stdout.replace(word, words[number])
    expected = on_linux(*words)
    assert (done.status, done.stderr) == (expected.returncode, expected.stderr)
    assert stdout.split() == expected.stdout.split()  # lines are a column shorter on Windows


def test_convert_and_recover(windows: Windows) -> None:
    for source, target in ((COMPLAINT, "a.mcap"), ("a.mcap", "b.pcapng")):
        done = windows.run("convert", source, target)
        assert (done.status, done.stderr) == (0, "")
    assert on_linux("audit", str(windows.folder / "b.pcapng")).returncode == 1
    recovered = windows.run("recover", "a.mcap")
    assert recovered.status == 0
    assert recovered.stdout.startswith("a.mcap: whole")


def test_demo(windows: Windows) -> None:
    done = windows.run("demo", "--out", "demo in a folder")
    assert (done.status, done.stderr) == (0, "")
    files = {path.name for path in (windows.folder / "demo in a folder").iterdir()}
    assert {"capture.mcap", "results.json", "report.html"} <= files
    assert ".spool" not in files
    assert 'scaraspec audit "demo in a folder\\capture.mcap"' in done.stdout


def test_call_and_certify_a_linux_controller(windows: Windows, linux_controller: str) -> None:
    assert windows.run("call", linux_controller, "get_version").stdout == "1.0.0\n"
    assert windows.run("ics", "new", linux_controller, "--out", "ics.toml").status == 0
    options = ("--allow", "state", "--only", "4.2,4.3,4.13")
    done = windows.run("certify", "controller", linux_controller, *options, "--out", "run")
    assert (done.status, done.stderr) == (0, ""), done.stdout
    files = {path.name for path in (windows.folder / "run").iterdir()}
    assert files == {"capture.mcap", "ctrf.json", "junit.xml", "report.html", "results.json"}
    results = json.loads((windows.folder / "run/results.json").read_text("utf-8"))
    verdicts = {case["verdict"] for case in results["cases"]}
    assert "pass" in verdicts
    assert not verdicts & {"fail", "error", "inconclusive"}
    assert windows.run("gate", "run", "--baseline", "base.json", "--update").status == 0
    assert windows.run("gate", "run", "--baseline", "base.json").status == 0


def test_verify_a_package(windows: Windows) -> None:
    mandatory = list_of_cases()
    results = certified(windows.folder, mandatory)
    capture = windows.folder / "capture.mcap"
    package = packed(windows.folder / "certification", results, capture, mandatory)
    done = windows.run("verify", windows_path(package))
    expected = on_linux("verify", str(package))
    assert (done.status, done.stderr) == (expected.returncode, expected.stderr)
    assert done.stdout == expected.stdout.replace(str(package), windows_path(package))


@pytest.mark.parametrize(("mutant", "status"), [(None, 0), ("default-is-forgotten", 1)])
def test_linux_certifies_a_controller_on_windows(
    windows: Windows, mutant: str | None, status: int
) -> None:
    options = ["--data", "robot", "--ready-file", "address"]
    if mutant:
        options += ["--mutant", mutant]
    with windows.started("controller", "--listen", "127.0.0.1:0", *options) as controller:
        controller.wait_for("listening on")
        url = f"tcp://{(windows.folder / 'address').read_text().strip()}"
        run = str(windows.folder / "run")
        case = ("--allow", "state", "--only", "4.2,4.3,4.13")
        done = on_linux("certify", "controller", url, *case, "--out", run)
        assert done.returncode == status, done.stdout + done.stderr
        controller.interrupt()
        output = controller.finish()
    assert (output.status, output.stderr) == (0, "")


def test_record_until_interrupted(windows: Windows, linux_controller: str) -> None:
    options = ("--listen", "127.0.0.1:0", "--out", "shift")
    with windows.started("record", linux_controller, *options) as recorder:
        recorder.wait_for("recording ")
        address = re.search(r"recording (\S+) to", recorder.stdout)
        assert address
        done = on_linux("call", f"tcp://{address[1]}", "get_version")
        assert done.stdout == "1.0.0\n", done.stderr
        recorder.interrupt()
        output = recorder.finish()
    assert output.status == 0, output.stderr
    assert "1 connections" in output.stdout
    assert {path.name for path in (windows.folder / "shift").iterdir()} == {"capture.mcap"}
    assert ": whole, " in on_linux("recover", str(windows.folder / "shift/capture.mcap")).stdout


def test_two_recorders_do_not_share_a_folder(windows: Windows, linux_controller: str) -> None:
    options = (linux_controller, "--listen", "127.0.0.1:0", "--out", "shift")
    with windows.started("record", *options) as recorder:
        recorder.wait_for("recording ")
        second = windows.run("record", *options)
        recorder.interrupt()
        recorder.finish()
    assert second.status == 2
    assert "another recorder writes into shift" in second.stderr


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("record", "tcp://127.0.0.1:9", "--mode", "redirect"), "only on Linux"),
        (("record", "tcp://127.0.0.1:9", "--mode", "tproxy"), "only on Linux"),
        (("record", "tcp://127.0.0.1:9", "--durable"), "durable needs a POSIX system"),
        (("controller", "--serial", "COM9", "--listen", "127.0.0.1:0"), "POSIX systems only"),
        (("client-driver",), "Linux and macOS only"),
        (("certify", "client", "--driver", "any.exe"), "Linux and macOS only"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_what_windows_lacks_is_one_sentence(
    windows: Windows, arguments: tuple[str, ...], sentence: str
) -> None:
    done = windows.run(*arguments)
    assert done.status in (2, 3)
    assert done.stderr.count("\n") == 1
    assert sentence in done.stderr
