"""`scaraspec prove`: runs the suite against mutants and writes which case kills which mutant."""

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

from scaraspec.cli.problems import Problem, no_such_mutant
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
_RUNS: Final = 50  # per worker process: pytest and hypothesis keep some memory of each run


@click.command(epilog=EXAMPLE)
@click.option(
    "--role",
    type=click.Choice([role.value for role in STANDS]),
    default=Role.CONTROLLER.value,
    show_default=True,
    help="The role of the mutants.",
)
@click.option(
    "--mutant", "mutant_ids", multiple=True, metavar="ID", help="Only this mutant; repeatable."
)
@click.option("--fault", "fault_ids", multiple=True, metavar="ID", hidden=True)  # the old name
@click.option("--only", metavar="LIST", help="Only mutants and cases of these requirements.")
@click.option(
    "--quick",
    is_flag=True,
    help="Run only the cases of the requirements that each mutant violates.",
)
@click.option(
    "--every", type=click.IntRange(1), default=1, metavar="N", help="Only every Nth mutant."
)
@click.option(
    "--brief",
    is_flag=True,
    help="Skip the cases that `certify controller` runs only with --exhaustive.",
)
@click.option("--list", "listed", is_flag=True, help="Print these mutants and run none.")
@click.option(
    "--dialects",
    "other_dialects",
    is_flag=True,
    help="Run the unmodified implementation in every reading and every pair; no mutants.",
)
@click.option(
    "--examples",
    type=click.IntRange(1, 100_000),
    default=20,
    show_default=True,
    help="How many generated values a case tries.",
)
@click.option(
    "--jobs",
    type=click.IntRange(1),
    default=os.cpu_count() or 1,
    show_default=True,
    help="How many worker processes run.",
)
@click.option("--out", type=_PATH, metavar="DIR", help="Write kill-matrix.ROLE.json here.")
def command(  # noqa: PLR0913 - one for each option
    *,
    role: str,
    mutant_ids: tuple[str, ...],
    fault_ids: tuple[str, ...],
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
    """Show that the suite finds faults: run it against mutants of our controller or client.

    A mutant is killed if a case of a requirement that it violates fails. --quick runs only these
    cases: it kills the same mutants, in minutes instead of hours. Cases that kill none of the
    mutants are printed. Exit status 0: every mutant is killed and the unmodified implementation
    is conformant; 1: otherwise; 4: there is no mutant or no case to run.
    """
    mutant_ids += fault_ids
    party = Role(role)
    if listed and (quick or out):
        raise Problem("--list runs no mutant: remove --quick, --out")
    options = Options(
        only=_requirements(only),
        allowed=ALL,
        undefined=True,
        examples=examples,
        exhaustive=True,
        brief=brief,
    )
    if other_dialects:
        if mutant_ids or quick or every > 1 or listed or out:
            raise Problem(
                "--dialects runs no mutant: remove --mutant, --quick, --every, --list, --out"
            )
        _prove_dialects(party, options, jobs)
        return
    chosen = _chosen(party, mutant_ids, options)[::every]
    if not chosen:
        raise _nothing_proved("none of these mutants violates a requirement of --only")
    if listed:
        for mutant in chosen:
            click.echo(_list_line(mutant))
        return
    unmodified = _try_unmodified(party, options)
    work = partial(proof_of, role=party, options=options, quick=quick)
    tried = [mutant.name for mutant in chosen]
    with closing(apart(work, tried, jobs=jobs, runs=_RUNS)) as pending:
        proofs = list(_with_progress(pending, len(chosen)))
    cases = [case.id for case in collect(options, party) if not (brief and case.slow)]
    idle = _idle(cases, proofs) if not mutant_ids and every == 1 else []
    counts = _counts(proofs)
    _print_summary(proofs, idle, counts)
    if out:
        out.mkdir(parents=True, exist_ok=True)
        matrix = {
            "role": role,
            "quick": quick,
            "without_fault": unmodified.value,
            "counts": {**counts, "cases": len(cases), "idle": len(idle)},
            "faults": [proof.plain() for proof in proofs],
            "idle": idle,
        }
        write_whole(
            out / MATRIX.format(role=role), json.dumps(matrix, ensure_ascii=False, indent=1) + "\n"
        )
    if counts["killed"] < counts["faults"] or unmodified is not Conclusion.CONFORMANT:
        raise SystemExit(ExitStatus.NONCONFORMANT)


def _try_unmodified(role: Role, options: Options) -> Conclusion:
    """Run the suite against the implementation without a fault and print the conclusion."""
    results = STANDS[role].prove(options)
    if any(case.id == "run.interrupted" for case in results.cases):
        raise KeyboardInterrupt
    click.echo(f"unmodified {role.value}: {results.verdict.value}, {len(results.cases)} cases")
    return results.verdict


def _print_summary(proofs: Iterable[Proof], idle: Iterable[str], counts: Mapping[str, int]) -> None:
    """Print the mutants that survived, the cases that killed none, and the counts."""
    for proof in proofs:
        if not proof.killers:
            violated = ", ".join(proof.requirements)
            click.echo(f"SURVIVED {proof.fault}: {proof.sentence} ({violated})")
    for case in idle:
        click.echo(f"kills no mutant: {case}")
    click.echo(
        "{killed} of {faults} mutants killed, {subtle_killed} of {subtle} subtle ones".format(
            **counts
        )
    )


def _nothing_proved(reason: str) -> SystemExit:
    click.echo(f"nothing proved: {reason}", err=True)
    return SystemExit(ExitStatus.NOTHING_TESTED)


def _requirements(only: str | None) -> frozenset[str] | None:
    try:
        return frozenset(r.id for r in select(only)) if only else None
    except UnknownRequirementError as error:
        raise Problem(UserMessage("--only: {error}", error=error)) from None


def _chosen(role: Role, mutant_ids: Sequence[str], options: Options) -> list[Mutant[Any]]:
    known = STANDS[role].faults()
    for mutant_id in mutant_ids:
        if mutant_id not in known:
            raise no_such_mutant(mutant_id, known, role.value)
    only = options.only
    return [
        mutant
        for name, mutant in known.items()
        if (not mutant_ids or name in mutant_ids)
        and (only is None or only & set(mutant.requirements))
    ]


def _list_line(mutant: Mutant[Any]) -> str:
    """Return the id, the sentence, the violated requirements and the readings in one line."""
    violated = ", ".join(mutant.requirements)
    under = f" under {', '.join(mutant.reading)}" if mutant.reading else ""
    subtle = "; subtle" if mutant.subtle else ""
    return f"{mutant.name}: {mutant.sentence} ({violated}{under}{subtle})"


def _prove_dialects(role: Role, options: Options, jobs: int) -> None:
    """Show that no case fails a conforming implementation, whichever readings it follows."""
    if not collect(options, role):
        raise _nothing_proved("no case tests a requirement of --only")
    tried = list(dialects())
    false_alarms = 0
    work = partial(alarm_of, role=role, options=options)
    with closing(apart(work, tried, jobs=jobs, runs=_RUNS)) as alarms:
        for number, alarm in enumerate(alarms, 1):
            false_alarms += alarm.false
            click.echo(f"{number}/{len(tried)} {alarm.verdict} {' '.join(alarm.readings)}")
            for case, message in alarm.cases.items():
                click.echo(f"    {case}: {message}")
    click.echo(f"{len(tried) - false_alarms} of {len(tried)} dialects conformant")
    if false_alarms:
        raise SystemExit(ExitStatus.NONCONFORMANT)


def _with_progress(proofs: Iterator[Proof], count: int) -> Iterator[Proof]:
    """Yield the proofs and show the progress: a bar on a terminal, lines elsewhere."""
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
    """Return the cases that kill no mutant."""
    killers = {case for proof in proofs for case in proof.killers}
    return [case for case in cases if case not in killers]


def _counts(proofs: Iterable[Proof]) -> dict[str, int]:
    """Count the mutants and the killed mutants, in total and of the subtle ones."""
    killed = [(proof.subtle, bool(proof.killers)) for proof in proofs]
    return {
        "faults": len(killed),
        "killed": sum(dead for _, dead in killed),
        "subtle": sum(subtle for subtle, _ in killed),
        "subtle_killed": sum(subtle and dead for subtle, dead in killed),
    }
