"""Whether verdicts are reliable on a busy machine: no false failure, and no mutant that passes.

The virtual controller and the driver of the reference client run as processes of their own, as a
user starts them, with the options of docs/ci.md. Most runs have four other busy processes.
"""

import argparse
import json
import random
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

from bench import peers

from scaraspec.api.proving import EVERYTHING, MATRIX
from scaraspec.mutants.controller import ControllerMutant, mutants
from scaraspec.report.model import Role
from scaraspec.suite.engine.collection import collect

BUSY_PROCESSES: Final = 4
MAX_REPRODUCTION_S: Final = 60.0
MIN_KILLERS: Final = 2
"""A mutant is tried if at least as many cases without a hook kill it: the processes have none."""

_ROOT: Final = Path(__file__).parent.parent
_SCARASPEC: Final = (sys.executable, "-m", "scaraspec")
_BUSY: Final = "import os\nparent = os.getppid()\nwhile os.getppid() == parent: sum(range(10_000))"
_SHOWN_CASES: Final = 3
_SCALE: Final = 8
_SERVE: Final = ("--time-scale", f"{_SCALE}", "--reading", f"xfer_timeout={_SCALE}")
_SOON: Final = ("--transfer-timeout", "1")
_GATED: Final = "4.8,4.15,4.20,5.2"
"""The clauses whose results are gated."""
_CERTIFY: Final = (
    *(*_SOON, "--patience", "1.25", "--exhaustive", "--undefined-opcodes"),
    *("--allow", "state,motion,destructive", "--yes"),
)

_say = partial(print, flush=True)


class Grade(Enum):
    """How a run ended with respect to its criterion."""

    MET = "met"
    INCONCLUSIVE = "inconclusive"
    NOT_MET = "NOT MET"


@dataclass
class Criterion:
    """A row of the final table: what must be true of some runs.

    Attributes:
        sentence: What must be true.
        max_inconclusive: How many of the runs may be inconclusive.
        grades: The grades of the runs that have ended.
    """

    sentence: str
    max_inconclusive: int = 0
    grades: list[Grade] = field(default_factory=list)

    @property
    def is_met(self) -> bool:
        """Whether no run that has ended contradicts it."""
        inconclusive = self.grades.count(Grade.INCONCLUSIVE)
        return Grade.NOT_MET not in self.grades and inconclusive <= self.max_inconclusive


class Step(NamedTuple):
    """One run, or one that repeats another.

    Attributes:
        criterion: What it must show.
        name: Its name in the output.
        run: Runs it in a folder; returns the grade, and what was observed.
        busy: Whether other processes are busy during it.
    """

    criterion: Criterion
    name: str
    run: Callable[[Path], tuple[Grade, str]]
    busy: bool


class Ended(NamedTuple):
    """The exit status of a certification, and the cases in its results.json."""

    status: int
    cases: Sequence[Mapping[str, Any]]

    def with_verdict(self, *verdicts: str) -> list[Mapping[str, Any]]:
        """Return the cases with one of these verdicts."""
        return [case for case in self.cases if case["verdict"] in verdicts]

    def __str__(self) -> str:
        bad = [f"{c['id']} {c['verdict']}" for c in self.with_verdict("fail", "error")]
        bad += [f"{c['id']} {c['verdict']}" for c in self.with_verdict("inconclusive")]
        shown = f": {', '.join(bad[:_SHOWN_CASES])}" if bad else ""
        return f"exit status {self.status}{shown}{', …' if bad[_SHOWN_CASES:] else ''}"


def main() -> None:
    """Run all steps and print a line for each, then the table."""
    parser = argparse.ArgumentParser(prog="trust", description=(__doc__ or "").partition("\n")[0])
    for name, count, text in (
        ("pairs", 1, "pairs of quiet runs with the same seed, for each role"),
        ("runs", 20, "certifications of the controller on a busy machine"),
        ("client-runs", 5, "certifications of the client on a busy machine"),
        ("mutants", 20, "mutants on a busy machine"),
        ("reproductions", 50, "mutants whose first finding is reproduced"),
        ("gates", 30, "gates of a conforming controller on a busy machine"),
        ("red-gates", 10, "gates of a mutant on a busy machine"),
        ("seed", 0, "seed that draws the mutants"),
    ):
        parser.add_argument(f"--{name}", type=int, default=count, help=f"{text} [{count}]")
    parser.add_argument("--out", type=Path, default=_ROOT / "reports/out/trust", metavar="DIR")
    options = parser.parse_args()
    steps = list(_steps(options))
    try:
        _run_all(steps, options.out)
    except KeyboardInterrupt:
        _say("interrupted")
    good = _print_table(steps)
    raise SystemExit(0 if good else 1)


def _steps(options: argparse.Namespace) -> Iterator[Step]:
    """Yield all steps; the quiet ones come first."""
    drawn = random.Random(options.seed)  # noqa: S311 - a sample
    equal = Criterion("quiet, with the same seed: every case has the same verdict twice")
    roles = (Role.CONTROLLER, certify_controller), (Role.CLIENT, certify_client)
    for role, certify in roles * options.pairs:
        yield Step(equal, f"{role.value}, quiet, twice", partial(_compare, certify), busy=False)
    reproduced = Criterion(f"reproduced in {MAX_REPRODUCTION_S:g} s with the same fingerprint")
    testable = _testable_mutants()
    for mutant in drawn.sample(testable, options.reproductions):
        yield Step(reproduced, mutant.name, partial(_reproduce, mutant), busy=False)
    passed = Criterion("conforming subjects never fail, and at most one run is inconclusive", 1)
    for number in range(options.runs):
        run = partial(_pass, certify_controller)
        yield Step(passed, f"controller, busy, run {number + 1}", run, busy=True)
    for number in range(options.client_runs):
        run = partial(_pass, certify_client)
        yield Step(passed, f"client, busy, run {number + 1}", run, busy=True)
    killed = Criterion("every mutant fails a requirement that it violates")
    for mutant in _of_different_clauses(testable, drawn)[: options.mutants]:
        yield Step(killed, mutant.name, partial(_kill, mutant), busy=True)
    gates = tuple(_gates(options, drawn))
    baseline = options.out / "baseline.json"
    if gates:
        accepted = Criterion("a gate accepts the baseline of a quiet run")
        yield Step(accepted, "baseline", partial(_accept, baseline), busy=False)
    green = Criterion("no gate of a conforming controller is red")
    red = Criterion("every gate of a mutant is red")
    for name, wrong in gates:
        yield Step(red if wrong else green, name, partial(_gate, baseline, wrong), busy=True)


def _gates(
    options: argparse.Namespace, drawn: random.Random
) -> Iterator[tuple[str, ControllerMutant | None]]:
    """Yield the name of each gate and its mutant, if it has one."""
    for number in range(options.gates):
        yield f"green gate {number + 1}", None
    clauses = tuple(f"{clause}/" for clause in _GATED.split(","))
    gated = [m for m in _testable_mutants() if m.requirements[0].startswith(clauses)]
    for mutant in drawn.sample(gated, options.red_gates):
        yield f"red gate, {mutant.name}", mutant


def _run_all(steps: Sequence[Step], out: Path) -> None:
    durations_s: dict[bool, list[float]] = {False: [], True: []}
    for number, step in enumerate(steps):
        folder = out / f"{number + 1}"
        folder.mkdir(parents=True, exist_ok=True)
        begun_s = time.monotonic()
        with _busy_processes(BUSY_PROCESSES if step.busy else 0):
            grade, observed = step.run(folder)
        lasted_s = time.monotonic() - begun_s
        durations_s[step.busy].append(lasted_s)
        step.criterion.grades.append(grade)
        known_s = [each_s for listed in durations_s.values() for each_s in listed]
        left_s = 0.0
        for later in steps[number + 1 :]:
            similar_s = durations_s[later.busy] or known_s
            left_s += sum(similar_s) / len(similar_s)
        _say(
            f"{number + 1}/{len(steps)} {step.name}: {grade.value}, {observed}, "
            f"{lasted_s:.0f} s, {left_s / 60:.0f} min left"
        )


def _print_table(steps: Sequence[Step]) -> bool:
    """Print a row for each criterion; return whether all runs have ended and all are met."""
    good = True
    _say(f"\n{'runs':>7} {'inconclusive':>13} {'not met':>8}  criterion")
    for criterion in {id(step.criterion): step.criterion for step in steps}.values():
        planned = sum(step.criterion is criterion for step in steps)
        grades = criterion.grades
        problem = "" if len(grades) == planned else "INCOMPLETE: "
        problem = problem if criterion.is_met else "NOT MET: "
        good = good and not problem
        _say(
            f"{f'{len(grades)}/{planned}':>7} {grades.count(Grade.INCONCLUSIVE):>13} "
            f"{grades.count(Grade.NOT_MET):>8}  {problem}{criterion.sentence}"
        )
    return good


# -------------------------------------------------------------------------------- the steps


def _compare(certify: Callable[[Path], Ended], folder: Path) -> tuple[Grade, str]:
    first, second = certify(folder / "first"), certify(folder / "second")
    verdicts = [{c["id"]: c["verdict"] for c in ended.cases} for ended in (first, second)]
    differing = sorted(dict(verdicts[0].items() ^ verdicts[1].items()))
    grade = Grade.NOT_MET if differing or not verdicts[0] else Grade.MET
    return grade, f"{first}; {len(differing)} cases differ {' '.join(differing[:5])}".rstrip()


def _pass(certify: Callable[[Path], Ended], folder: Path) -> tuple[Grade, str]:
    ended = certify(folder)
    grades = {0: Grade.MET, 3: Grade.INCONCLUSIVE}
    return grades.get(ended.status, Grade.NOT_MET), f"{ended}"


def _kill(mutant: ControllerMutant, folder: Path) -> tuple[Grade, str]:
    ended = certify_controller(folder, mutant)
    violated = {each for case in ended.with_verdict("fail") for each in case["requirements"]}
    killed = ended.status == 1 and violated.intersection(mutant.requirements)
    return Grade.MET if killed else Grade.NOT_MET, f"{ended}"


def _accept(baseline: Path, folder: Path) -> tuple[Grade, str]:
    """Write the baseline of the gates from a quiet run."""
    baseline.unlink(missing_ok=True)
    ended = certify_controller(folder, options=("--only", _GATED))
    status = _run_gate(folder, baseline, "--update")
    return Grade.NOT_MET if status else Grade.MET, f"{ended}; gate: exit status {status}"


def _gate(baseline: Path, mutant: ControllerMutant | None, folder: Path) -> tuple[Grade, str]:
    """Certify, and let the gate decide: 0 or 1, never 3."""
    ended = certify_controller(folder, mutant, options=("--only", _GATED))
    status = _run_gate(folder, baseline)
    grade = Grade.MET if status == bool(mutant) else Grade.NOT_MET
    return grade, f"{ended}; gate: exit status {status}"


def _run_gate(folder: Path, baseline: Path, *options: str) -> int:
    command = [*_SCARASPEC, "gate", f"{folder}", "--baseline", f"{baseline}", *options]
    with (folder / "gate.txt").open("wb") as output:
        return subprocess.run(command, stdout=output, stderr=output, check=False).returncode  # noqa: S603 - ours


def _reproduce(mutant: ControllerMutant, folder: Path) -> tuple[Grade, str]:
    """Repeat the first finding with the printed command, against a new process."""
    port = peers.free_port()
    tested = {each for case in collect(EVERYTHING, Role.CONTROLLER) for each in case.requirements}
    only = ("--only", ",".join(each for each in mutant.requirements if each in tested))
    failed = certify_controller(folder / "found", mutant, port, only).with_verdict("fail")
    if not failed:
        return Grade.NOT_MET, "nothing was found"
    command = shlex.split(failed[0]["replay"])[1:]
    begun_s = time.monotonic()
    with _virtual_controller(folder, port, mutant):
        again = _run(folder / "again", *command, *_journal(folder), "--yes")
    lasted_s = time.monotonic() - begun_s
    same = failed[0]["fingerprint"] in [c["fingerprint"] for c in again.with_verdict("fail")]
    grade = Grade.MET if same and lasted_s < MAX_REPRODUCTION_S else Grade.NOT_MET
    return grade, f"{failed[0]['id']} {'again' if same else 'not again'} in {lasted_s:.0f} s"


def certify_controller(
    folder: Path,
    mutant: ControllerMutant | None = None,
    port: int | None = None,
    options: Sequence[str] = (),
) -> Ended:
    """Certify the virtual controller, or a mutant of it, in processes of their own."""
    folder.mkdir(parents=True, exist_ok=True)
    ics = folder / "fast.toml"
    ics.write_text(f"[subject]\ntime_scale = {_SCALE}\n")
    port = port or peers.free_port()
    with _virtual_controller(folder, port, mutant):
        url = f"tcp://{peers.HOST}:{port}"
        how = ("--ics", f"{ics}", *_CERTIFY, *_journal(folder), *options)
        return _run(folder, "certify", "controller", url, *how)


def certify_client(folder: Path) -> Ended:
    """Certify the reference client with its driver."""
    driver = shlex.join((*_SCARASPEC, "client-driver", *_SOON))
    return _run(folder, "certify", "client", "--driver", driver, *_SOON)


def _run(folder: Path, *arguments: str) -> Ended:
    folder.mkdir(parents=True, exist_ok=True)
    results = folder / "results.json"
    results.unlink(missing_ok=True)
    command = [*_SCARASPEC, *arguments, "--out", f"{folder}"]
    with (folder / "output.txt").open("wb") as output:
        done = subprocess.run(command, stdout=output, stderr=output, check=False)  # noqa: S603 - ours
    cases = json.loads(results.read_text("utf-8"))["cases"] if results.exists() else ()
    return Ended(done.returncode, cases)


def _journal(folder: Path) -> tuple[str, str]:
    return "--state-dir", f"{folder / 'state'}"


@contextmanager
def _virtual_controller(folder: Path, port: int, mutant: ControllerMutant | None) -> Iterator[None]:
    listen = ("--listen", f"{peers.HOST}:{port}")
    wrong = ("--mutant", mutant.name) if mutant else ()
    serve = [*_SCARASPEC, "controller", *listen, *_SERVE, *wrong]
    with peers.running(serve, port, folder / "controller.txt"):
        yield


@contextmanager
def _busy_processes(count: int) -> Iterator[None]:
    """Keep processors busy. The processes also end if this one is killed."""
    busy = [subprocess.Popen([sys.executable, "-c", _BUSY]) for _ in range(count)]  # noqa: S603 - ours
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


# -------------------------------------------------------------------------------- the mutants


def _testable_mutants() -> list[ControllerMutant]:
    """The mutants in the default dialect that enough cases without a hook kill."""
    matrix = json.loads((_ROOT / "reports" / MATRIX.format(role="controller")).read_text("utf-8"))
    killers = {row["fault"]: row["killers"] for row in matrix["faults"]}
    hookless = {case.id for case in collect(EVERYTHING, Role.CONTROLLER) if not case.needs}
    return [
        mutant
        for mutant in mutants().values()
        if not mutant.reading
        and len(hookless.intersection(killers.get(mutant.name, ()))) >= MIN_KILLERS
    ]


def _of_different_clauses(
    testable: Sequence[ControllerMutant], drawn: random.Random
) -> list[ControllerMutant]:
    """One mutant of each clause, in random order."""
    shuffled = drawn.sample(testable, len(testable))
    return [*{m.requirements[0].partition("/")[0]: m for m in shuffled}.values()]


if __name__ == "__main__":
    main()
