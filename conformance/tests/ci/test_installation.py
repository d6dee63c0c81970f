"""The install commands of the templates, and the services of Compose, in a new environment."""

import os
import re
import site
import subprocess
import sys
from pathlib import Path

import pytest
from ci_systems import TEMPLATES, Job, free_port
from wording import ROOT

from scaraspec.report.model import Results

pytestmark = pytest.mark.runs

_TIMEOUT_S = 120


@pytest.fixture
def job(tmp_path: Path) -> Job:
    """A job that installs the wheel, with the environment of the Jenkinsfile.

    The dependencies of scaraspec are those of the test's environment.
    """
    pytest.importorskip("build", reason="the oldest dependencies are tested without it")
    build = (sys.executable, "-m", "build", "--no-isolation", "--wheel", "--outdir", tmp_path, ROOT)
    subprocess.run(build, check=True, capture_output=True, timeout=_TIMEOUT_S)
    (wheel,) = tmp_path.glob("*.whl")
    variables = {
        "PATH": os.environ["PATH"],
        "PYTHONPATH": "",
        "PIP_NO_INDEX": "1",
        "PIP_NO_DEPS": "1",
        "PACKAGE": str(wheel),
    }
    job = Job(tmp_path, free_port(), variables)
    job.jenkins({"SCARASPEC_PACKAGE": str(wheel)}, new_seed=0, stages=slice(1))
    assert job.status == 0, job.log
    (packages,) = tmp_path.glob(".scaraspec/lib/*/site-packages")
    (packages / "dependencies.pth").write_text("\n".join(site.getsitepackages()), "utf-8")
    job.variables = variables | {"PATH": f"{tmp_path}/.scaraspec/bin:{os.environ['PATH']}"}
    return job


def test_docker_and_compose(job: Job) -> None:
    """The image installs the wheel; the suite certifies the controller and passes."""
    dockerfile = (TEMPLATES / "Dockerfile").read_text("utf-8")
    (command,) = re.findall(r"^RUN (.*)$", dockerfile, re.MULTILINE)
    job.run("sh", "-c", command)
    assert job.status == 0, job.log
    assert 'ENTRYPOINT ["scaraspec"]' in dockerfile
    given = {
        "SCARASPEC_URL": f"tcp://127.0.0.1:{job.port}",
        "SCARASPEC_OPTIONS": "--only 4.7",
        "SCARASPEC_SEED": "20261126",
    }
    controller = subprocess.Popen(
        job.compose("controller", {}), cwd=job.folder, env=os.environ | job.variables
    )
    try:
        job.run(*job.compose("suite", given))
    finally:
        controller.terminate()
        controller.wait(_TIMEOUT_S)
    assert job.status == 0, job.log
    results = Results.read(job.folder / "scaraspec-out/results.json")
    assert results.run
    assert results.run.seed == 20261126
