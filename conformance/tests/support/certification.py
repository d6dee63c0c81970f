"""A small certification on the simulated clock, and packages of it."""

import json
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from scaraspec.api.calibration import Calibration, chosen_mutants
from scaraspec.api.certificates import Certification, write_package
from scaraspec.certificate.checks import PATIENCE_S, certification_options
from scaraspec.certificate.mandatory import MandatoryList
from scaraspec.judge.verdicts import Conclusion
from scaraspec.mutants.controller_run import PASSWORD, Robot, tokens
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import Results, Role, Tool
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.run import Run
from scaraspec.traffic.wire import WireEvent
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec_recorder.recordings.capture import capture_sink
from scaraspec_recorder.sinks.mcap.mcap_sink import CLAIM, SUBJECT
from scaraspec_recorder.sinks.sink import OutputFolder

Verify = Callable[..., tuple[int, str]]
"""Runs the command, and returns its exit status and output."""

STATUS = "4.8/2"
CASES = ("2/11.wrong-login", "4.1/2", STATUS, "4/3.fault")
ICS = Ics(
    name="Cell 7",
    version="1.4",
    sample={"serial_number": "7", "firmware": "1.4", "hardware": "B"},
    laboratory={"name": "Lab", "operator": "Li"},
)


def list_of_cases(ids: tuple[str, ...] = CASES) -> MandatoryList:
    """Return a list of a few cases, for this version."""
    cases = {case.id: case.requirements for case in collect(Options()) if case.id in ids}
    return MandatoryList(
        "controller-2026-01-01",
        Role.CONTROLLER,
        Tool.own().version,
        cases,
        optional_hooks=("clear_faults", "motor_fault"),
    )


def calibrated() -> Calibration:
    """Return a calibration that has succeeded."""
    killed = dict.fromkeys(chosen_mutants(Role.CONTROLLER, 0), (STATUS,))
    return Calibration(Role.CONTROLLER, 0, Conclusion.CONFORMANT, killed)


def certification_of(path: Path, mandatory: MandatoryList) -> Certification:
    """Return a certification of a controller, after the calibration."""
    options = certification_options(Role.CONTROLLER, mandatory)
    return Certification(path, mandatory, options, calibrated())


def certified(
    folder: Path,
    mandatory: MandatoryList,
    core: type[ControllerCore] = ControllerCore,
    ics: Ics = ICS,
) -> Results:
    """Run these cases on the simulated clock as a certification does, and write all files."""
    robot = Robot(core, DEFAULT)
    options = certification_options(Role.CONTROLLER, mandatory)
    events = list[WireEvent]()
    adapter = ControllerAdapter(
        MemoryAccess(robot.network),
        ics,
        PASSWORD,
        replace(options, only=frozenset(), cases=frozenset(mandatory.cases)),
        link="memory",
        capture="capture.mcap",
        draw_token=tokens().__next__,
    )
    results = Run(adapter, take=events.append).results()
    assert results.run
    whole = {**options.summary, "patience_s": PATIENCE_S}  # the small list is the whole list
    settings = {**adapter.settings, **whole}
    results = replace(results, run=replace(results.run, settings=settings))
    claims = {f"{CLAIM}{key}": value for key, value in ics.recorded.items()}
    sink = capture_sink(
        OutputFolder(folder, []),
        session={SUBJECT: "controller", **claims},
        draw=False,
        redact=True,
    )
    for event in events:
        sink.write(event)
    sink.close()
    results.write(folder / "results.json")
    return results


def packed(folder: Path, results: Results, capture: Path, mandatory: MandatoryList) -> Path:
    """Write a package of these results and all files that belong to it into a new folder."""
    folder.mkdir()
    results.write(folder / "results.json")
    shutil.copy(capture, folder)
    path = folder / "forged.scaraspec.zip"
    write_package(certification_of(path, mandatory), folder, ICS)
    return path


def rezipped(package: Path, path: Path, **changes: bytes | None) -> Path:
    """Write a package with other files; None leaves one out. ``__`` in a name is a dot."""
    texts = {name.replace("__", "."): data for name, data in changes.items()}
    with zipfile.ZipFile(package) as source, zipfile.ZipFile(path, "w") as target:
        files: dict[str, bytes | None] = {name: source.read(name) for name in source.namelist()}
        for name, data in {**files, **texts}.items():
            if data is not None:
                target.writestr(name, data)
    return path


def plain_in(package: Path, name: str) -> dict[str, object]:
    """Return the object in a JSON file of a package."""
    with zipfile.ZipFile(package) as archive:
        plain: dict[str, object] = json.loads(archive.read(name))
    return plain
