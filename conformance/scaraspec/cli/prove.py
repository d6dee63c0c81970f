"""`scaraspec prove`: the suite against seeded faults, and the matrix of what found what."""

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any, Final

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from scaraspec.cli.problems import Problem, no_such_fault
from scaraspec.judge.requirements import UnknownRequirementError, select
from scaraspec.judge.verdicts import Conclusion, ExitStatus
from scaraspec.mutants.kill_matrix import STANDS, Proof, alarm_of, dialects, proof_of
from scaraspec.mutants.registry import Mutant
from scaraspec.mutants.worker_pool import apart
from scaraspec.report.files import write_whole
from scaraspec.report.model import Role
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import collect
from scaraspec.user_message import UserMessage

EXAMPLE = "Example: scaraspec prove --only 4.15 --out proof"

_PATH = click.Path(path_type=Path)
MATRIX: Final = "kill-matrix.{role}.json"
_RUNS: Final = 50  # in one process, for pytest and hypothesis keep something of each


@click.command(epilog=EXAMPLE)
@click.option(
    "--role",
    type=click.Choice([role.value for role in STANDS]),
    default=Role.CONTROLLER.value,
    show_default=True,
    help="What is faulty.",
)
@click.option("--fault", "names", multiple=True, metavar="ID", help="Only this one; repeatable.")
@click.option("--only", metavar="LIST", help="Only faults and cases of these requirements.")
@click.option(
    "--quick", is_flag=True, help="Against each fault, run only the cases of what it violates."
)
@click.option(
    "--every", type=click.IntRange(1), default=1, metavar="N", help="Only every Nth of the faults."
)
@click.option(
    "--brief", is_flag=True, help="Run no case that `certify controller` needs --exhaustive for."
)
@click.option("--list", "listed", is_flag=True, help="Say what these faults are, and try none.")
@click.option(
    "--dialects",
    "other_dialects",
    is_flag=True,
    help="No faults: the faultless one under every reading, and every pair of them.",
)
@click.option(
    "--examples",
    type=click.IntRange(1, 100_000),
    default=20,
    show_default=True,
    help="How many values a drawn case tries.",
)
@click.option(
    "--jobs",
    type=click.IntRange(1),
    default=os.cpu_count() or 1,
    show_default=True,
    help="How many processes work.",
)
@click.option("--out", type=_PATH, metavar="DIR", help="Write kill-matrix.ROLE.json here.")
def command(  # noqa: PLR0913 - one for each option
    *,
    role: str,
    names: tuple[str, ...],
    only: str | None,
    quick: bool,
    every: int,
    brief: bool,
    listed: bool,
    other_dialects: bool,
    examples: int,
    jobs: int,
    out: Path | None,
) -> None:
    """Show that the suite bites: run it against our controller or client with each seeded fault.

    A fault is killed where a case fails of a requirement that it violates; so --quick, with no
    other case than those, kills as many, minutes instead of hours. A case that kills no fault of
    those that were run is told. Exit status 0 where every fault is killed and the faultless
    implementation conformant, 1 where not, 4 where there was no fault or no case to run.
    """
    party = Role(role)
    if listed and (quick or out):
        raise Problem("--list tries no fault: leave --quick, --out")
    options = Options(
        only=_requirements(only),
        allowed=ALL,
        undefined=True,
        examples=examples,
        exhaustive=True,
        brief=brief,
    )
    if other_dialects:
        if names or quick or every > 1 or listed or out:
            raise Problem(
                "--dialects tries no fault: leave --fault, --quick, --every, --list, --out"
            )
        _prove_dialects(party, options, jobs)
        return
    chosen = _chosen(party, names, options)[::every]
    if not chosen:
        raise _nothing_proved("none of these faults violates what --only names")
    if listed:
        for fault in chosen:
            click.echo(_told(fault))
        return
    sound = _without_fault(party, options)
    work = partial(proof_of, role=party, options=options, quick=quick)
    tried = [fault.name for fault in chosen]
    with closing(apart(work, tried, jobs=jobs, runs=_RUNS)) as found:
        proofs = list(_shown(found, len(chosen)))
    cases = [case.id for case in collect(options, party) if not (brief and case.slow)]
    idle = _idle(cases, proofs) if not names and every == 1 else []
    counts = _counts(proofs)
    _tell(proofs, idle, counts)
    if out:
        out.mkdir(parents=True, exist_ok=True)
        matrix = {
            "role": role,
            "quick": quick,
            "without_fault": sound.value,
            "counts": {**counts, "cases": len(cases), "idle": len(idle)},
            "faults": [proof.plain() for proof in proofs],
            "idle": idle,
        }
        write_whole(
            out / MATRIX.format(role=role), json.dumps(matrix, ensure_ascii=False, indent=1) + "\n"
        )
    if counts["killed"] < counts["faults"] or sound is not Conclusion.CONFORMANT:
        raise SystemExit(ExitStatus.NONCONFORMANT)


def _without_fault(role: Role, options: Options) -> Conclusion:
    """What the faultless implementation gets, told."""
    sound = STANDS[role].prove(options)
    if any(case.id == "run.interrupted" for case in sound.cases):
        raise KeyboardInterrupt
    click.echo(f"without a fault: {sound.verdict.value}, {len(sound.cases)} cases")
    return sound.verdict


def _tell(proofs: Iterable[Proof], idle: Iterable[str], counts: Mapping[str, int]) -> None:
    """What survived, what found nothing, and how many there were."""
    for proof in proofs:
        if not proof.killers:
            violated = ", ".join(proof.requirements)
            click.echo(f"SURVIVED {proof.fault}: {proof.sentence} ({violated})")
    for case in idle:
        click.echo(f"kills nothing: {case}")
    click.echo(
        "{killed} of {faults} faults killed, {subtle_killed} of {subtle} subtle".format(**counts)
    )


def _nothing_proved(why: str) -> SystemExit:
    click.echo(f"nothing proved: {why}", err=True)
    return SystemExit(ExitStatus.NOTHING_TESTED)


def _requirements(only: str | None) -> frozenset[str] | None:
    try:
        return frozenset(r.id for r in select(only)) if only else None
    except UnknownRequirementError as error:
        raise Problem(UserMessage("--only: {error}", error=error)) from None


def _chosen(role: Role, names: Sequence[str], options: Options) -> list[Mutant[Any]]:
    known = STANDS[role].faults()
    for name in names:
        if name not in known:
            raise no_such_fault(name, known, role.value)
    only = options.only
    return [
        fault
        for name, fault in known.items()
        if (not names or name in names) and (only is None or only & set(fault.requirements))
    ]


def _told(fault: Mutant[Any]) -> str:
    """A fault in one line: its name, what it does, and what it violates, under which readings."""
    violated = ", ".join(fault.requirements)
    under = f" under {', '.join(fault.reading)}" if fault.reading else ""
    return f"{fault.name}: {fault.sentence} ({violated}{under}{'; subtle' if fault.subtle else ''})"


def _prove_dialects(role: Role, options: Options, jobs: int) -> None:
    """Show that no conforming implementation is failed, whatever readings it follows."""
    if not collect(options, role):
        raise _nothing_proved("no case tries what --only names")
    spoken = list(dialects())
    wrong = 0
    work = partial(alarm_of, role=role, options=options)
    with closing(apart(work, spoken, jobs=jobs, runs=_RUNS)) as alarms:
        for number, alarm in enumerate(alarms, 1):
            wrong += alarm.false
            click.echo(f"{number}/{len(spoken)} {alarm.verdict} {' '.join(alarm.readings)}")
            for case, message in alarm.cases.items():
                click.echo(f"    {case}: {message}")
    click.echo(f"{len(spoken) - wrong} of {len(spoken)} dialects conformant")
    if wrong:
        raise SystemExit(ExitStatus.NONCONFORMANT)


def _shown(proofs: Iterator[Proof], count: int) -> Iterator[Proof]:
    """The same, with progress: a bar on a terminal, lines elsewhere."""
    console = Console()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(
        *columns, TimeElapsedColumn(), console=console, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("proving", total=count)
        for number, proof in enumerate(proofs, 1):
            bar.update(task, advance=1, description=proof.fault)
            if not console.is_terminal:
                by = ", ".join(proof.killers) or "nothing"
                click.echo(f"{number}/{count} {proof.fault}: killed by {by}")
            yield proof


def _idle(cases: Iterable[str], proofs: Iterable[Proof]) -> list[str]:
    """Cases that kill no fault."""
    killers = {case for proof in proofs for case in proof.killers}
    return [case for case in cases if case not in killers]


def _counts(proofs: Iterable[Proof]) -> dict[str, int]:
    """How many faults there were, how many of them were killed, and so of the subtle ones."""
    killed = [(proof.subtle, bool(proof.killers)) for proof in proofs]
    return {
        "faults": len(killed),
        "killed": sum(dead for _, dead in killed),
        "subtle": sum(subtle for subtle, _ in killed),
        "subtle_killed": sum(subtle and dead for subtle, dead in killed),
    }
