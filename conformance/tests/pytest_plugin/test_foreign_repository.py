"""The plugin in the repository of a team, with the plugins, fixtures and settings of the team."""

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from warm_process import WarmProcess

from scaraspec.judge.verdicts import Conclusion
from scaraspec.report.model import Results

SETTINGS = """
[tool.pytest.ini_options]
addopts = ["--strict-markers", "--strict-config", "-p", "no:cacheprovider"]
filterwarnings = ["error"]
timeout = 0.01
python_files = ["check_*.py"]
python_functions = ["check_*"]
"""

CONFTEST = """
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("team", max_examples=7, derandomize=True)
settings.load_profile("team")


@pytest.fixture
def subject():
    return "of the team"


@pytest.fixture(autouse=True)
def line():
    return None


@pytest.fixture(autouse=True, scope="session")
def simulator(pytestconfig):
    yield
    out = pytestconfig.getoption("--scaraspec-out")
    assert not out or Path(out, "results.json").exists(), "the run ends while the simulator runs"
"""

TESTS = """
import os
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytestmark = pytest.mark.timeout(30)
tried = []


def check_subject(subject):
    assert subject == "of the team"


@given(st.integers())
def check_profile(number):
    tried.append(number)
    assert settings.get_current_profile_name() == "team"
    assert len(tried) <= 7


@pytest.mark.skipif("scaraspec.api" in sys.modules, reason="the option was given")
def check_nothing_is_loaded():
    loaded = {name for name in sys.modules if name.partition(".")[0].startswith("scaraspec")}
    assert loaded == {
        *("scaraspec", "scaraspec.pytest_plugin", "scaraspec.cli", "scaraspec.cli.vocabulary")
    }


@pytest.mark.skipif("TEAM_FAILS" not in os.environ, reason="it fails")
def check_that_fails():
    assert False
"""

WITH_THE_FIXTURE = """
import pytest


@pytest.mark.timeout(30)
def check_client(scaraspec_subject):
    assert scaraspec_subject.get_version()
"""

Pytest = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A repository of a team, with its own folder `conformance`."""
    folder = tmp_path / "repository"
    (folder / "conformance").mkdir(parents=True)
    (folder / "pyproject.toml").write_text(SETTINGS, "utf-8")
    (folder / "conftest.py").write_text(CONFTEST, "utf-8")
    (folder / "conformance/check_own.py").write_text(TESTS, "utf-8")
    return folder


@pytest.fixture
def run(repository: Path) -> Pytest:
    """Run pytest in the repository with all installed plugins."""

    def start(*arguments: str, **variables: str) -> "subprocess.CompletedProcess[str]":
        own = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
        return subprocess.run(
            [sys.executable, "-m", "pytest", "-v", *arguments],
            cwd=repository,
            env={**own, **variables},
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )

    return start


def _controller(*arguments: str) -> Iterator[str]:
    process = WarmProcess("controller", "--listen", "127.0.0.1:0", *arguments, merged=True)
    assert process.stdout
    address = re.search(r"tcp://[\d.:]+", process.stdout.readline())
    assert address
    yield address[0]
    os.kill(process.pid, 15)
    process.communicate()


@pytest.fixture(scope="module")
def controller() -> Iterator[str]:
    """The URL of a conforming controller."""
    yield from _controller()


@pytest.fixture(scope="module")
def mutant() -> Iterator[str]:
    """The URL of a controller that violates 4.8/2."""
    yield from _controller("--mutant", "status-of-one-digit")


def _certify(url: str, only: str) -> tuple[str, ...]:
    return ("--scaraspec-certify", "--scaraspec-subject", url, "--scaraspec-only", only)


def test_without_options(run: Pytest) -> None:
    """Only the tests of the team run, and nothing of scaraspec is imported for them."""
    done = run()
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 passed, 1 skipped" in done.stdout
    assert "scaraspec/test_" not in done.stdout


def test_without_a_controller(run: Pytest) -> None:
    """The cases without a controller are a usage error of pytest."""
    done = run("--scaraspec-certify")
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert "no controller: name it with --scaraspec-subject" in done.stderr


def test_conforming(run: Pytest, controller: str, repository: Path) -> None:
    """The cases run in order after the tests of the team, with their requirements."""
    files = ("--junitxml", "junit.xml", "--html", "report.html", "--scaraspec-out", "out")
    (repository / "conformance/check_client.py").write_text(WITH_THE_FIXTURE, "utf-8")
    done = run(*_certify(controller, "2/1,4.7/2"), *files)
    assert done.returncode == 0, done.stdout + done.stderr
    order = re.findall(r"^(\w+).*::\w+ PASSED", done.stdout, re.MULTILINE)
    assert order == ["conformance"] * 3 + ["scaraspec"] * 3
    cases = [
        [p.get("value") for p in case.iter("property") if p.get("name") == "requirement"]
        for case in ET.parse(repository / "junit.xml").iter("testcase")
    ]
    assert [requirements[:1] for requirements in cases if requirements] == [["4.7/2"], ["2/1"]]
    results = Results.read(repository / "out/results.json")
    assert results.verdict is Conclusion.CONFORMANT
    assert {case.replay for case in results.cases} == {
        f"scaraspec certify controller {controller} --seed 0 --only case:{case.id}"
        for case in results.cases
    }
    assert (repository / "report.html").exists()


@pytest.mark.runs
def test_violation(run: Pytest, mutant: str) -> None:
    """A case that fails is one failed test, and gives exit status 1."""
    done = run(*_certify(mutant, "4.8/2"))
    assert done.returncode == 1, done.stdout + done.stderr
    assert "1 failed" in done.stdout
    assert "scaraspec/test_4_08_status.py::test_idle FAILED" in done.stdout
    assert "nonconformant" in done.stdout


@pytest.mark.runs
def test_failure_of_the_team(run: Pytest, controller: str) -> None:
    """A failed test of the team gives exit status 1, although the controller conforms."""
    done = run(*_certify(controller, "4.7/2"), TEAM_FAILS="1")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "conformant: tcp://" in done.stdout


@pytest.mark.runs
def test_several_workers(run: Pytest, controller: str, repository: Path) -> None:
    """All tests that use the controller run on one worker, which sends the exit status of the
    results."""
    (repository / "conformance/check_client.py").write_text(WITH_THE_FIXTURE, "utf-8")
    inconclusive = ("--scaraspec-require", "4.35/5")
    done = run("-n", "2", "--dist", "worksteal", *_certify(controller, "4.7"), *inconclusive)
    assert done.returncode == 3, done.stdout + done.stderr
    ran = re.findall(r"^\[(gw\d)\].* (\w\S+)::", done.stdout, re.MULTILINE)
    workers = {worker for worker, name in ran if not name.endswith("check_own.py")}
    assert len(workers) == 1, done.stdout
    assert "inconclusive: tcp://" in done.stdout
