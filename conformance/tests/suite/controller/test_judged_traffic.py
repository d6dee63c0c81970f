"""Violations that the judge finds in the traffic of the suite, as in a recording."""

from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller import mutants
from scaraspec.mutants.controller_run import PASSWORD, Robot
from scaraspec.protocol.commands import Network, Point
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.controller.harness.requests.files import upload
from scaraspec.suite.controller.harness.requests.poses import initial_of
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import Observer
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.program_files.layout import short_program
from scaraspec.virtual_controller.core import ControllerCore

NAME = b"zs-seen.rob"
SETTINGS = [
    (
        "new-network-answered-with-zero",
        "4.4/2",
        "network",
        Network("10.0.0.9", "255.0.0.0", "10.0.0.1"),
    ),
    ("new-default-answered-with-zero", "4.13/2 4.13/5", "default_program", NAME),
    ("gripper-answered-with-zero", "4.20/2", "gripper_center", Point(1, 2, 3)),
    ("position-answered-with-zero", "4.21/2", "initial_tool_position", None),
]


def _violations(make: type[ControllerCore], name: str, value: Any) -> set[str]:
    """Return the requirements that a setting between two queries violates."""
    ics = Ics(dialect=DEFAULT)
    access = MemoryAccess(Robot(make, DEFAULT).network)
    adapter = ControllerAdapter(access, ics, PASSWORD, Options(allowed=ALL))
    observer = Observer(adapter.role, ics)
    subject = adapter.subject(observer)
    line = subject.open()
    upload(line, NAME, short_program(subject))
    value = value or initial_of(line)._replace(theta_x=1.0)
    for request, argument in ((f"get_{name}", None), (f"set_{name}", value), (f"get_{name}", None)):
        line.wait(0.01)
        line.ask(request, argument)
    subject.close_lines()
    observer.close()
    failed = (s.finding for s in observer.findings if s.finding.verdict is Verdict.FAIL)
    return {finding.requirement for finding in failed}


@pytest.mark.parametrize(("fault", "requirements", "name", "value"), SETTINGS)
def test_refused_setting_that_takes_effect(
    fault: str, requirements: str, name: str, value: Any
) -> None:
    """A setting that is answered 0 and takes effect is a violation."""
    assert _violations(mutants()[fault].wrong, name, value) == {*requirements.split()}
    assert _violations(ControllerCore, name, value) == set()
