"""`scaraspec audit` as a user runs it: whose violations count, and which claims apply."""

import shlex
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from traffic_notation import script

from scaraspec.cli.main import group
from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Conclusion, ExitStatus, Verdict
from scaraspec.report.model import Results
from scaraspec.traffic.wire import UNJUDGED, WireEvent
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sources.mcap_reader import read_mcap

__all__ = ["script"]

Script = Callable[[str], list[WireEvent]]

OWN_CLIENT = f"{shlex.quote(sys.executable)} -m scaraspec client-driver"
MUTANT = """
import asyncio
from scaraspec.client.driver import serve
from scaraspec.mutants.client import mutants

make = mutants()["asks-for-the-version-first"].wrong
asyncio.run(serve(lambda url, password: make(url, password=password)))
"""
BOTH_WRONG = """
    login
    > get_status 1
    < get_status 0
    > get_status
    < get_status 0
"""
"""A request with data that its command does not have, and two replies with one digit."""


@pytest.fixture
def audit(tmp_path: Path) -> Callable[..., tuple[Result, Results]]:
    """Audit a file with options; return the output and the results."""

    def run(file: Path, *options: str) -> tuple[Result, Results]:
        json_file = tmp_path / "audit.json"
        words = ["audit", f"{file}", *options, "--json", f"{json_file}"]
        done = CliRunner().invoke(group, words)
        assert json_file.exists(), done.output
        return done, Results.read(json_file)

    return run


@pytest.fixture
def recorded(tmp_path: Path, script: Script) -> Callable[..., Path]:
    """Record a session, with metadata as in the file of a certification."""

    def write(session: str, **description: str) -> Path:
        path = tmp_path / "capture.mcap"
        known = {key.replace("__", "."): value for key, value in description.items()}
        decoder = Decoder([McapSink(path.open("wb"), known)], Judge())
        for event in script(session):
            decoder.write(event)
        decoder.close()
        return path

    return write


def failed(results: Results) -> set[str]:
    """The requirements that failed, or the cases."""
    cases = [case for case in results.cases if case.verdict is Verdict.FAIL]
    return {(*case.requirements, case.id)[0] for case in cases}


def ics(folder: Path, text: str) -> str:
    """Write an ICS file."""
    file = folder / "ics.toml"
    file.write_text(text, encoding="utf-8")
    return f"{file}"


# The capture of a certification


def test_the_capture_of_a_conforming_controller(
    processes: Any, audit: Callable[..., tuple[Result, Results]], tmp_path: Path
) -> None:
    """Violations of the suite on purpose do not count, and the claims of the run apply."""
    host, port = processes.controller("--time-scale", "8")
    out, claims = tmp_path / "out", ics(tmp_path, "[subject]\ntime_scale = 8\n")
    done = processes.run(
        *("certify", "controller", f"tcp://{host}:{port}", "--only", "4.5/5,4.6/2"),
        *("--ics", claims, "--allow", "state", "--patience", "1", "--out", f"{out}"),
    )
    assert done.returncode == 0, done.stdout + done.stderr
    capture = out / "capture.mcap"
    reported = read_mcap(capture).session
    assert (reported["subject"], reported["subject.time_scale"]) == ("controller", "8")

    done, results = audit(capture)
    assert done.exit_code == 0, done.output
    assert "Only the controller is judged" in done.output
    assert [*results.readings] == ["controller"]
    undecided = {case.id for case in results.cases if case.verdict is Verdict.NONE}
    assert undecided == {"4.5/4", "4.6/4", "4.9/5"}
    assert "4.5/1" in failed(audit(capture, "--subject", "client")[1])


def test_the_capture_of_a_faulty_controller(
    processes: Any, audit: Callable[..., tuple[Result, Results]], tmp_path: Path
) -> None:
    """The audit fails with the requirement of the run."""
    host, port = processes.controller("--mutant", "status-of-one-digit")
    out = tmp_path / "out"
    done = processes.run(
        "certify", "controller", f"tcp://{host}:{port}", "--only", "4.8/2", "--out", f"{out}"
    )
    assert done.returncode == 1, done.stdout + done.stderr
    done, results = audit(out / "capture.mcap")
    assert done.exit_code == ExitStatus.NONCONFORMANT
    assert "4.8/2" in failed(results) & failed(Results.read(out / "results.json"))


@pytest.mark.parametrize(("faulty", "violated"), [(False, set()), (True, {"2/10"})])
def test_the_capture_of_a_client(
    processes: Any,
    audit: Callable[..., tuple[Result, Results]],
    tmp_path: Path,
    *,
    faulty: bool,
    violated: set[str],
) -> None:
    """The audit fails with the requirement of the run, and only for the client."""
    driver, out = tmp_path / "driver.py", tmp_path / "out"
    driver.write_text(MUTANT, encoding="utf-8")
    line = f"{shlex.quote(sys.executable)} {shlex.quote(f'{driver}')}" if faulty else OWN_CLIENT
    done = processes.run(
        "certify", "client", "--driver", line, "--only", "2/10,3/20", "--out", f"{out}"
    )
    assert done.returncode == bool(violated), done.stdout + done.stderr
    assert failed(Results.read(out / "results.json")) == violated
    done, results = audit(out / "capture.mcap")
    assert (done.exit_code, failed(results)) == (bool(violated), violated), done.output
    assert "Only the client is judged" in done.output
    assert "the suite sends invalid bytes on purpose: " in done.output
    assert failed(audit(out / "capture.mcap", "--subject", "both")[1]) > violated


# Any capture


@pytest.mark.parametrize(
    ("subject", "violated", "left_out"),
    [
        ("controller", {"4.8/2", "T/7"}, "the client that are left out: 1"),
        ("client", {"4.8/1"}, "the controller that are left out: 4"),
        ("both", {"4.8/1", "4.8/2", "T/7"}, ""),
    ],
)
def test_the_subject(
    audit: Callable[..., tuple[Result, Results]],
    recorded: Callable[..., Path],
    subject: str,
    violated: set[str],
    left_out: str,
) -> None:
    """Only findings about the subject count; those about the other side are counted separately."""
    file = recorded(BOTH_WRONG)
    done, results = audit(file, "--subject", subject)
    assert failed(results) == violated
    assert left_out in done.output
    assert ("left out" in done.output) is bool(left_out)
    assert {case.replay for case in results.cases} == {
        f"scaraspec audit {file} --subject {subject}"
    }


@pytest.mark.parametrize(
    ("description", "conclusion"),
    [
        ({}, Conclusion.NONCONFORMANT),
        ({"subject": "client"}, Conclusion.NO_VIOLATION),
        ({"subject": "controller"}, Conclusion.NONCONFORMANT),
    ],
)
def test_the_subject_that_the_file_names(
    audit: Callable[..., tuple[Result, Results]],
    recorded: Callable[..., Path],
    description: Mapping[str, str],
    conclusion: Conclusion,
) -> None:
    """It is judged; without one, both sides are judged."""
    file = recorded("login\n> get_status\n< get_status 0", **description)
    done, results = audit(file)
    assert results.verdict is conclusion
    assert done.exit_code == conclusion.exit_status


def test_connections_that_are_not_judged(
    audit: Callable[..., tuple[Result, Results]], recorded: Callable[..., Path]
) -> None:
    """The audit of a capture skips the connections that the run did not judge."""
    file = recorded(f"> open {UNJUDGED}" + BOTH_WRONG + "\n2> login password\n2< login 1")
    done, results = audit(file, "--subject", "controller")
    assert failed(results) == set()
    assert "invalid bytes on purpose: 1" in done.output
    assert failed(audit(file)[1]) >= {"4.8/2"}


UNANSWERED = (
    "login\n> get_time\n+6\n> get_status\n< get_status 00\n+6\n> get_status\n< get_status 00"
)
FAST_CLOCK = """
    login
    > get_time
    < get_time 20260516120000
    +2
    > get_time
    < get_time 20260516120016
"""


@pytest.mark.parametrize(
    ("session", "text", "without", "with_ics"),
    [
        (UNANSWERED, "[readings]\nreply_timeout = 10\n", {"3/31"}, set()),
        ("> get_status\n< get_status 00", "[subject]\nurl = 'rfcomm://AA:BB:CC:DD:EE:FF/1'\n",
         {"2/10"}, set()),
        (UNANSWERED, "[subject]\nlacks = ['get_time']\n", {"3/31"}, set()),
        (FAST_CLOCK, "[subject]\ntime_scale = 8\n", {"4.6/4"}, set()),
        ("login\n> get_status\n< get_status 00", "[subject]\nlacks = ['get_status']\n",
         set(), {"claim.lacks.get_status"}),
    ],
)  # fmt: skip
def test_claims(  # noqa: PLR0913 - fixtures and parameters
    audit: Callable[..., tuple[Result, Results]],
    recorded: Callable[..., Path],
    tmp_path: Path,
    *,
    session: str,
    text: str,
    without: set[str],
    with_ics: set[str],
) -> None:
    """The ICS has the timeouts, the link, the unsupported commands and the speed of the clock."""
    file = recorded(session)
    assert failed(audit(file)[1]) == without
    assert failed(audit(file, "--ics", ics(tmp_path, text))[1]) == with_ics


def test_unsupported_commands(
    audit: Callable[..., tuple[Result, Results]], recorded: Callable[..., Path], tmp_path: Path
) -> None:
    """Those without a reply are not in scope; those without a request are listed."""
    claims = ics(tmp_path, "[subject]\nlacks = ['get_time', 'jog']\n")
    done, results = audit(recorded(UNANSWERED), "--subject", "controller", "--ics", claims)
    listed = {each.id.partition("/")[0] for each in results.requirements}
    assert "4.6" not in listed
    assert "4.28" in listed
    assert "Not verified: the ICS claims that jog is unsupported" in done.output
    assert results.label.endswith(", without get_time, jog")


def test_claims_of_the_run_and_further_readings(
    audit: Callable[..., tuple[Result, Results]], recorded: Callable[..., Path]
) -> None:
    """The file's claims apply, and `--reading` changes one of them."""
    file = recorded(UNANSWERED, subject="controller", subject__readings__reply_timeout="10")
    assert failed(audit(file)[1]) == set()
    _, results = audit(file, "--reading", "reply_timeout=5")
    assert failed(results) == {"3/31"}
    assert results.readings["controller"]["reply_timeout"].claimed == "5"
    assert {case.replay for case in results.cases} == {
        f"scaraspec audit {file} --reading reply_timeout=5"
    }


@pytest.mark.parametrize(
    ("description", "expected_text"),
    [
        ({"subject": "robot"}, "'robot' is not a valid Role"),
        ({"subject__time_scale": "fast"}, "fast"),
        ({"subject__lacks": "fly"}, "fly"),
        ({"subject__readings__endian": "middle"}, "middle"),
        ({"subject__mood": "good"}, "subject.mood is not known"),
    ],
)
def test_a_wrong_description(
    refused: Callable[..., str],
    recorded: Callable[..., Path],
    description: Mapping[str, str],
    expected_text: str,
) -> None:
    """The error message names the file."""
    file = recorded("login", **description)
    message = refused("audit", f"{file}")
    assert f"{file} has an invalid description of its subject: " in message
    assert expected_text in message


@pytest.mark.parametrize(
    ("text", "expected_text"),
    [("[subject]\nlacks = ['fly']\n", "fly"), ("[subject]\nurl = 'http://x'\n", "http://x")],
)
def test_a_wrong_ics(
    refused: Callable[..., str],
    recorded: Callable[..., Path],
    tmp_path: Path,
    text: str,
    expected_text: str,
) -> None:
    """The mistakes are reported."""
    assert expected_text in refused("audit", f"{recorded('login')}", "--ics", ics(tmp_path, text))
