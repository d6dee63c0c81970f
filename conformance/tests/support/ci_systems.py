"""The shell steps of the CI templates, run as the CI systems run them, without containers."""

import os
import re
import socket
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import yaml  # type: ignore[import-untyped] # it ships no types
from wording import ROOT

TEMPLATES: Final = ROOT / "ci"
_TIMEOUT_S: Final = 120
_CI_VARIABLES: Final = ("GITHUB_", "CI_")
_NONE: Final[Mapping[str, str]] = MappingProxyType({})


@dataclass
class Job:
    """A job in its folder.

    Attributes:
        folder: The working directory, such as a clone of the repository.
        port: It replaces the default port 8877, which another process may use.
        variables: Environment variables of all steps.
        status: The exit status of the first step that failed, or 0.
        log: The output of the steps.
        kept: The paths of the artifacts.
        outputs: The outputs of the steps, on GitHub.
    """

    folder: Path
    port: int = 8877
    variables: Mapping[str, str] = field(default_factory=dict)
    status: int = 0
    log: str = ""
    kept: tuple[str, ...] = ()
    outputs: dict[str, str] = field(default_factory=dict)

    def run(self, *command: str, variables: Mapping[str, str] = _NONE) -> None:
        """Run a command, unless a step has failed."""
        if self.status:
            return
        outside = {n: v for n, v in os.environ.items() if not n.startswith(_CI_VARIABLES)}
        done = subprocess.run(
            command,
            cwd=self.folder,
            env={**outside, **self.variables, **variables},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=_TIMEOUT_S,
            check=False,
        )
        self.status, self.log = done.returncode, self.log + done.stdout

    def template(self, name: str) -> str:
        """Return the text of a template."""
        return (TEMPLATES / name).read_text("utf-8").replace("8877", f"{self.port}")

    def workflow(self, path: str, *, event: str, run_id: int) -> None:
        """Run the only job of a workflow of GitHub, which uses the action."""
        (job,) = yaml.safe_load((self.folder / path).read_text("utf-8"))["jobs"].values()
        (step,) = (step for step in job["steps"] if "/scaraspec/" in step["uses"])
        assert re.fullmatch(r"OWNER/scaraspec/ci@v[\d.]+", step["uses"])
        self.github(step["with"], event=event, run_id=run_id)

    def github(self, given: Mapping[str, str], *, event: str, run_id: int) -> None:
        """Run the steps of the action with its inputs."""
        action = yaml.safe_load(self.template("action.yml"))
        inputs = {name: each["default"] for name, each in action["inputs"].items()}
        assert given.keys() <= inputs.keys()
        inputs |= given
        output = self.folder / ".github-output"
        output.touch()
        variables = {
            "GITHUB_ACTIONS": "true",
            "GITHUB_EVENT_NAME": event,
            "GITHUB_RUN_ID": f"{run_id}",
            "GITHUB_OUTPUT": str(output),
            "GITHUB_STEP_SUMMARY": str(self.folder / ".github-summary"),
        }
        for step in action["runs"]["steps"]:
            if "run" in step:
                values = {n: _filled(v, inputs) for n, v in step["env"].items()}
                shell = (step["shell"], "--noprofile", "--norc", "-eo", "pipefail", "-c")
                self.run(*shell, step["run"], variables=variables | values)
            elif step["uses"].startswith("actions/upload-artifact@"):
                assert step["if"] == "always()"
                self.kept += (step["with"]["path"],)
        self.outputs = dict(line.split("=") for line in output.read_text("utf-8").splitlines())

    def gitlab(self, config: Mapping[str, Any], *, source: str, pipeline_id: int) -> None:
        """Run the only job of a `.gitlab-ci.yml`, which extends the job of the template."""
        (job,) = (each for name, each in config.items() if name != "include")
        extended = yaml.safe_load(self.template("gitlab.yml"))[job["extends"]]
        variables = {"CI_PIPELINE_SOURCE": source, "CI_PIPELINE_ID": f"{pipeline_id}"}
        variables |= extended["variables"] | job["variables"]
        script = "\n".join(extended["script"])
        self.run("bash", "-eo", "pipefail", "-c", script, variables=variables)
        assert extended["artifacts"]["when"] == "always"
        self.kept += tuple(extended["artifacts"]["paths"])

    def jenkins(self, given: Mapping[str, str], *, new_seed: int, stages: slice) -> None:
        """Run the shell steps of some stages, with other values of the variables."""
        text = self.template("Jenkinsfile")
        variables = dict[str, str](re.findall(r"(SCARASPEC_\w+) = '(.*?)' //", text))
        variables["PATH"] = f"{self.folder}/.scaraspec/bin:{self.variables['PATH']}"
        variables |= {"NEW_SEED": f"{new_seed}", **given}
        steps = re.findall(r"""\bsh '(?:'')?([^'].*?)'(?:'')?\n""", text, re.DOTALL)
        for step in steps[stages]:
            self.run("sh", "-xec", step, variables=variables)
        assert "always {" in text
        self.kept += tuple(re.findall(r"artifacts: '([\w-]+)/\*\*'", text))

    def compose(self, service: str, given: Mapping[str, str]) -> list[str]:
        """Return the command line of a service, whose image has the entry point `scaraspec`."""
        text = interpolated(self.template("compose.yaml"), given)
        found = yaml.safe_load(text)["services"][service]
        command = found["command"]
        words = command.split() if isinstance(command, str) else command
        return [*found.get("entrypoint", ["scaraspec"]), *words]


def free_port() -> int:
    """Return a free port below the range that the system uses for connections."""
    for port in range(20000 + os.getpid() % 10000, 32768):
        with suppress(OSError), socket.create_server(("127.0.0.1", port)):
            return port
    raise AssertionError("no port is free")


def _filled(text: str, inputs: Mapping[str, str]) -> str:
    filled = re.sub(r"\$\{\{ inputs\.([\w-]+) \}\}", lambda match: inputs[match[1]], text)
    assert "${{" not in filled
    return filled


def interpolated(text: str, values: Mapping[str, str]) -> str:
    """Return a Compose file with the values of its variables."""

    def value_of(match: re.Match[str]) -> str:
        if match[0] == "$$":
            return "$"
        value = values.get(match[1] or match[4], "")
        if match[2] == ":-":
            return value or match[3]
        return value and interpolated(match[3], values) if match[2] == ":+" else value

    return re.sub(r"\$\$|\$\{(\w+)(?:(:[-+])([^}]*))?\}|\$(\w+)", value_of, text)
