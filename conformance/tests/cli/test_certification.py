"""`scaraspec certify … --certification`: what it needs, and the package that it writes."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from certification import CASES, calibrated, list_of_cases

from scaraspec.api import calibration, certificates
from scaraspec.api import certify as certify_api
from scaraspec.certificate import checks
from scaraspec.certificate.package import PackageError
from scaraspec.cli.certify import controller_run, preparation
from scaraspec.cli.main import main
from scaraspec.judge.verdicts import Conclusion, ExitStatus
from scaraspec.report.model import Results, Role
from scaraspec.suite.engine.plan import Options

ICS = """
[subject]
name = "Cell 7"
[sample]
serial_number = "7"
firmware = "1.4"
hardware = "B"
[laboratory]
name = "Lab"
operator = "Li"
[hooks]
set_input = "true"
"""
ALLOW = ("--allow", "state,motion,destructive", "--yes")

Run = Callable[..., tuple[int, str]]


@pytest.fixture
def certify(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Run:
    """Run the command with an ICS; return its exit status and output."""
    monkeypatch.setenv("SCARASPEC_STATE", str(tmp_path / "state"))
    ics = tmp_path / "ics.toml"

    def run(*arguments: object, role: str = "controller", text: str = ICS) -> tuple[int, str]:
        ics.write_text(text, "utf-8")
        words = ["certify", role, *map(str, arguments), "--ics", f"{ics}", "--certification"]
        monkeypatch.setattr(sys, "argv", ["scaraspec", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        shown = capsys.readouterr()
        return int(ended.value.code or 0), shown.out + shown.err

    return run


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the list of mandatory cases by a small one, and run only its cases."""
    options_of = checks.certification_options

    def small_options(*arguments: Any, **choices: Any) -> Options:
        return replace(options_of(*arguments, **choices), only=frozenset(), cases=frozenset(CASES))

    monkeypatch.setattr(certificates, "mandatory_lists", lambda _: (list_of_cases(),))
    monkeypatch.setattr(checks, "certification_options", small_options)
    monkeypatch.setattr(certificates, "calibrate", lambda *_, **__: calibrated())
    # These cases belong to pytest.
    monkeypatch.setattr(controller_run, "end_on_signals", lambda _: None)


@pytest.mark.usefixtures("small")
def test_certified(certify: Run, processes: Any, tmp_path: Path) -> None:
    """The package is beside the output folder, and is verified immediately."""
    host, port = processes.controller()
    out, package = tmp_path / "run-1", tmp_path / "run-1.scaraspec.zip"
    status, text = certify(f"tcp://{host}:{port}", *ALLOW, "--out", out)
    assert status == 0, text
    assert f"{package}: verified, unsigned: Cell 7" in text
    results = Results.read(out / "results.json")
    assert results.run
    assert results.run.settings["certification"].startswith("controller-2026-01-01 sha256:")
    capture = (out / "capture.mcap").read_bytes()
    assert b"\x08password" not in capture
    assert certificates.verify_package(package).exit_status == 0


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize(
    ("broken", "says"),
    [
        ((certify_api, "write_package"), "the package cannot be written: [Errno 28] No space left"),
        ((preparation, "verify_package"), "run.zip: its files cannot be extracted"),
    ],
)
def test_full_disk(  # noqa: PLR0913 - each is a fixture or a parameter
    certify: Run,
    processes: Any,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    *,
    broken: tuple[Any, str],
    says: str,
) -> None:
    """The results are shown, and the exit status is 3, or 1 for a violation."""

    def fail(*_: object) -> None:
        if broken[1] == "write_package":
            raise OSError(28, "No space left on device")
        raise PackageError("its files cannot be extracted", ExitStatus.INCONCLUSIVE)

    monkeypatch.setattr(*broken, fail)
    for mutant, expected in ((), 3), (("--mutant", "status-of-one-digit"), 1):
        host, port = processes.controller(*mutant)
        out = tmp_path / f"run-{expected}"
        arguments = ("--out", out, "--package", tmp_path / "new" / f"{expected}" / "run.zip")
        status, text = certify(f"tcp://{host}:{port}", *ALLOW, *arguments)
        assert status == expected, text
        assert says in text
        assert "requirements in scope judged" in text
        assert (out / "results.json").exists()


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"reference": Conclusion.INCONCLUSIVE}, "the reference implementation is inconclusive"),
        ({"mutants": {"status-in-words": ()}}, "no case kills status-in-words"),
    ],
)
def test_no_certification_without_calibration(
    certify: Run,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    change: dict[str, Any],
    message: str,
) -> None:
    """If the calibration finds no fault, nothing is sent and nothing is certified."""
    unfit = replace(calibrated(), **change)
    monkeypatch.setattr(certificates, "calibrate", lambda *_, **__: unfit)
    status, text = certify("tcp://127.0.0.1:1", *ALLOW, "--out", tmp_path / "out")
    assert (status, f"no certification on this machine: {message}" in text) == (3, True)
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("small")
def test_interrupted_calibration(
    certify: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Ctrl-C ends it with one sentence; nothing is sent and nothing is written."""

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(certificates, "calibrate", interrupted)
    status, text = certify("tcp://127.0.0.1:1", *ALLOW, "--out", tmp_path / "out")
    assert (status, text.splitlines()[-1]) == (3, "scaraspec: interrupted")
    assert {file.name for file in tmp_path.iterdir()} <= {"ics.toml", "state"}


@pytest.mark.parametrize("role", [Role.CONTROLLER, Role.CLIENT])
def test_the_seed_chooses_the_mutants(role: Role) -> None:
    """Each seed of a certification selects other mutants."""
    choices = [tuple(calibration.chosen_mutants(role, seed)) for seed in checks.SEEDS]
    assert len({*choices}) == len(choices)
    assert {len({*choice}) for choice in choices} == {calibration.MUTANTS}


def test_a_calibration(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mutant is killed, and the reference implementation is conformant."""
    monkeypatch.setattr(calibration, "chosen_mutants", lambda *_: ["status-in-words"])
    found = calibration.calibrate(Role.CONTROLLER, 3)
    assert found.problem == ""
    assert "4.8/2" in found.mutants["status-in-words"]


@pytest.mark.usefixtures("small")
def test_nonconformant(certify: Run, processes: Any, tmp_path: Path) -> None:
    """The package of a nonconformant controller is written; the exit status is that of the run."""
    host, port = processes.controller("--mutant", "status-of-one-digit")
    package = tmp_path / "other.scaraspec.zip"
    arguments = (*ALLOW, "--out", tmp_path / "out", "--package", package)
    status, text = certify(f"tcp://{host}:{port}", *arguments)
    assert status == 1, text
    assert "the controller is nonconformant" in text
    assert text.endswith(f"{package}: verified, unsigned: Cell 7: nonconformant\n")


@pytest.mark.parametrize(
    "option",
    [
        *(("--only", "4.8"), ("--require", "4.8"), ("--require-coverage", "5%")),
        *(("--examples", "1"), ("--fail-fast",), ("--patience", "1")),
    ],
)
def test_fixed_options(certify: Run, tmp_path: Path, option: tuple[str, ...]) -> None:
    status, text = certify("tcp://127.0.0.1:1", *ALLOW, "--out", tmp_path / "out", *option)
    assert status == 2
    assert f"--certification fixes the options: leave out {option[0]}" in text


def test_no_attended_certification(certify: Run, tmp_path: Path) -> None:
    """`--certification` excludes `--attended`: a checklist has only some of the cases."""
    arguments = ("--listen", "127.0.0.1:0", "--attended", "--out", tmp_path / "out")
    status, text = certify(*arguments, role="client", text=ICS.partition("[hooks]")[0])
    assert (status, "leave out --attended" in text) == (2, True)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("Li", ""), "a certification needs operator in [laboratory] of the ICS"),
        (("firmware", "# firmware"), "a certification needs firmware in [sample] of the ICS"),
        (("set_input", "# set_input"), "a certification needs the hook set_input"),
        (("firmware", "software"), "sample.software is not known"),
        (('"1.4"', "1.4"), "sample.firmware must be str"),
    ],
)
def test_incomplete_ics(
    certify: Run, tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    arguments = ("tcp://127.0.0.1:1", *ALLOW, "--out", tmp_path / "out")
    status, text = certify(*arguments, text=ICS.replace(*change))
    assert (status, message in text) == (2, True), text


def test_missing_prerequisites(certify: Run, tmp_path: Path) -> None:
    """Hazards that are not allowed, no output folder, a wrong seed, no TCP link, an existing
    file."""
    url, out = "tcp://127.0.0.1:1", ("--out", tmp_path / "out")
    status, text = certify(url, "--allow", "state", *out)
    assert (status, "--allow destructive,motion is missing" in text) == (2, True)
    status, text = certify(url, *ALLOW)
    assert (status, "--certification needs --out DIR" in text) == (2, True)
    status, text = certify(url, *ALLOW, *out, "--seed", "10")
    assert (status, "the seed of a certification is 0 to 9, not 10" in text) == (2, True)
    status, text = certify("serial:///dev/ttyS9", *ALLOW, *out)
    assert (status, "--certification needs a TCP link" in text) == (2, True)
    status, text = certify(url, *ALLOW, *out, "--package", tmp_path / "ics.toml" / "a.zip")
    assert (status, "a.zip cannot be written: name another file" in text) == (2, True)
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "results.json").touch()
    status, text = certify(url, *ALLOW, "--out", tmp_path / "used")
    assert (status, "contains results.json of an earlier run" in text) == (2, True)
    (tmp_path / "out.scaraspec.zip").touch()
    status, text = certify(url, *ALLOW, *out)
    assert (status, "name another file with --package" in text) == (2, True)
    assert not (tmp_path / "out").exists()


def test_package_needs_certification(refused: Callable[..., str]) -> None:
    text = refused("certify", "controller", "tcp://127.0.0.1:1", "--package", "a.zip")
    assert "--package needs --certification" in text
