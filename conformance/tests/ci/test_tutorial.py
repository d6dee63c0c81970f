"""The tutorial creates a repository whose gate fails and then passes, with several subjects.

The files and commands are read from the page. Pushes run the templates in clones of the repository.
"""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import pytest
import yaml  # type: ignore[import-untyped] # it ships no types
from ci_systems import Job, free_port
from wording import ROOT

from scaraspec.report.model import Results, Role

pytestmark = pytest.mark.runs

PAGE = (ROOT / "docs/tutorial-ci.md").read_text("utf-8")
_BLOCK = re.compile(
    r"^(?:`([^`]+)` .*\n(?:.+\n)*\n)?(?:<!-- .* -->\n)*```(\w+)\n((?s:.*?))^```$", re.MULTILINE
)
_TIMEOUT_S = 120
PROGRAMS = {
    "pip": '#!/bin/sh\n[ "$*" = "install scaraspec==0.3.0" ]\n',
    "scaraspec": f"""#!{sys.executable}
import sys
sys.modules["rerun"] = None
from scaraspec.cli.main import main
if __name__ == "__main__":  # the process of the recorder imports this file
    main()
""",
}
"""A replacement of pip that installs nothing, and a scaraspec without the extra `view`."""


class Block(NamedTuple):
    """A fenced block; `name` is the name of the file with this content."""

    name: str
    language: str
    text: str


def blocks(section: str) -> Iterator[Block]:
    """Yield the blocks of a section of the page, in order."""
    body = re.split(rf"^## (?:\d\. )?{section}$", PAGE, flags=re.MULTILINE)[1].partition("\n## ")[0]
    for match in _BLOCK.finditer(body):
        yield Block(match[1] or "", match[2], match[3])


@dataclass
class Repository:
    """A clone of an empty repository, and the CI system of its origin.

    Attributes:
        folder: The clone.
        port: The port of the subject; it replaces 8877 in the page and in the templates.
        variables: The environment of all commands.
    """

    folder: Path
    port: int
    variables: dict[str, str]
    pushes: int = 0

    def local(self, text: str) -> str:
        """Return text of the page with the port of this test."""
        return text.replace("8877", f"{self.port}")

    def follow(self, section: str) -> None:
        """Write the files of a section, and run its commands."""
        for block in blocks(section):
            if block.name:
                self.write(block.name, self.local(block.text))
            elif block.language == "sh":
                self.run(self.local(block.text))

    def write(self, name: str, text: str) -> None:
        """Write a file."""
        (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
        (self.folder / name).write_text(text, "utf-8")

    def run(self, commands: str) -> str:
        """Run commands in a shell that ends at the first failure; each must succeed."""
        done = subprocess.run(
            ["bash", "-ec", commands],
            cwd=self.folder,
            env=os.environ | self.variables,
            capture_output=True,
            text=True,
            timeout=_TIMEOUT_S,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    def job(self) -> Job:
        """Return a job in a new clone of the latest push."""
        self.pushes += 1
        folder = self.folder.parent / f"job-{self.pushes}"
        self.run(f"git clone --quiet --branch $(git branch --show-current) ../origin.git {folder}")
        return Job(folder, self.port, self.variables)


@pytest.fixture
def repository(tmp_path: Path) -> Repository:
    """An empty repository, in an environment with these programs."""
    programs = tmp_path / "bin"
    programs.mkdir()
    for name, text in PROGRAMS.items():
        (programs / name).write_text(text, "utf-8")
        (programs / name).chmod(0o755)
    who = {
        f"GIT_{role}_{what}": "team"
        for role in ("AUTHOR", "COMMITTER")
        for what in ("NAME", "EMAIL")
    }
    variables = who | {
        "PATH": f"{programs}:{Path(sys.executable).parent}:{os.environ['PATH']}",
        "GIT_CONFIG_GLOBAL": os.devnull,
    }
    repository = Repository(tmp_path / "firmware", free_port(), variables)
    for command in ("init --bare --initial-branch=main origin.git", "clone origin.git firmware"):
        subprocess.run(
            ["git", *command.split()],
            cwd=tmp_path,
            check=True,
            capture_output=True,
            timeout=_TIMEOUT_S,
        )
    return repository


def seed_of(job: Job) -> int:
    """Return the seed in the results of a job; check that its reproduction commands have it."""
    results = Results.read(job.folder / "scaraspec-out/results.json")
    assert results.run
    assert all(f"--seed {results.run.seed}" in case.replay for case in results.cases if case.replay)
    return results.run.seed


def test_github(repository: Repository) -> None:
    """All steps of the page, with the virtual controller."""

    def job(event: str = "pull_request") -> Job:
        job = repository.job()
        job.workflow(".github/workflows/robot.yml", event=event, run_id=987654321012)
        assert (job.folder / "scaraspec-out/report.html").exists()
        assert job.kept == ("scaraspec-out",)
        assert job.outputs == {"exit-status": f"{job.status}"}
        return job

    for section in ("Describe the firmware", "Make a baseline", "Write the workflow"):
        repository.follow(section)
    for section, status in (
        ("See it red", 1),
        ("Accept a known deviation", 0),
        ("See a regression", 1),
    ):
        repository.follow(section)
        ended = job()
        assert ended.status == status, ended.log
        assert seed_of(ended) == 0
        (expected,) = (block.text for block in blocks(section) if block.language == "text")
        assert expected.strip() in ended.log
        assert ended.log.count("new failure ·") == status
    repository.follow("Correct the faults")
    nightly = job("schedule")
    assert nightly.status == 0, nightly.log
    assert seed_of(nightly) == 987654321012
    shutil.copytree(nightly.folder / "scaraspec-out", repository.folder / "scaraspec-out")
    repository.follow("Update the baseline")
    assert "987654321012" in repository.run("git show origin/next-version:baseline.json")


def test_foreign_controller_on_gitlab(repository: Repository) -> None:
    """The version of a controller of another origin becomes empty, and is corrected."""
    firmware = Path(__file__).with_name("foreign_controller.py").read_text("utf-8")
    repository.follow("Describe the firmware")
    repository.write("firmware.py", firmware)
    repository.write("sut.sh", f"exec python3 firmware.py {repository.port}\n")
    repository.follow("Make a baseline")
    (config,) = blocks("GitLab")
    repository.write(config.name, config.text)
    repository.run(next(block.text for block in blocks("Write the workflow") if not block.name))

    def job(source: str) -> Job:
        job = repository.job()
        job.gitlab(yaml.safe_load(config.text), source=source, pipeline_id=4711)
        return job

    repository.write("firmware.py", firmware.replace("2.7.1", ""))
    repository.run("git commit -am 'No version'; git push origin HEAD")
    red = job("merge_request_event")
    assert red.status == 1
    assert "new failure · 4.7/2 · the version is empty" in red.log
    assert seed_of(red) == 0
    repository.write("firmware.py", firmware)
    repository.run("git commit -am 'Correct the version'; git push origin HEAD")
    green = job("schedule")
    assert green.status == 0, green.log
    assert seed_of(green) == 4711
    assert {"sut.log", "gate.xml", "gate.json"} <= {
        file.name for file in (green.folder / "scaraspec-out").iterdir()
    }


def test_client_on_jenkins(repository: Repository) -> None:
    """The example driver in Python first sends data with the request for the version, then none."""
    driver = (ROOT / "fixtures/drivers/driver.py").read_text("utf-8")
    faulty = driver.replace("(0x08, decode", "(0x08, lambda _: b'?', decode")
    assert faulty != driver
    (inputs,) = (yaml.safe_load(block.text) for block in blocks("A client"))
    given = {f"SCARASPEC_{name.upper()}": value for name, value in inputs.items()}
    for text, seed, status in ((faulty, 0, 1), (driver, 33, 0)):
        job = Job(repository.folder, repository.port, repository.variables)
        repository.write("driver.py", text)
        job.jenkins(given, new_seed=seed, stages=slice(1, 2))
        assert job.status == status, job.log
        assert ("new failure · 4.7/1" in job.log) is bool(status)
        assert seed_of(job) == seed
        assert Results.read(job.folder / "scaraspec-out/results.json").role is Role.CLIENT
