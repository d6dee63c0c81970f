"""`scaraspec prove`: runs the suite against mutants and writes which case kills which mutant."""

import itertools
import os
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click
from rich.console import Console
from rich.progress import TimeRemainingColumn

from scaraspec.cli.problems import Problem, no_such_mutant
from scaraspec.cli.progress_bar import ProgressBar
from scaraspec.judge.requirements import UnknownRequirementError, select
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.model import Results, Role
from scaraspec.suite.engine.collection import METHODS, collect
from scaraspec.suite.engine.plan import Options
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.api.proving import KillMatrix
    from scaraspec.mutants.kill_matrix import Alarm, Proof
    from scaraspec.mutants.registry import Mutant

EXAMPLE = "Example: scaraspec prove --only 4.15 --out proof"

_PATH = click.Path(path_type=Path)


@click.command(epilog=EXAMPLE)
@click.option(
    "--role",
    type=click.Choice([role.value for role in METHODS]),
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
    mutants are printed. Exit status 0: every mutant is killed, and no case fails or is
    inconclusive on the unmodified implementation; 1: otherwise; 4: there is no mutant or no case
    to run.
    """
    from scaraspec.api.proving import EVERYTHING, mutants, prove  # noqa: PLC0415 - all mutants

    mutant_ids += fault_ids
    subject = Role(role)
    if listed and (quick or out):
        raise Problem("--list runs no mutant: remove --quick, --out")
    options = replace(EVERYTHING, only=_requirements(only), examples=examples, brief=brief)
    if other_dialects:
        if mutant_ids or quick or every > 1 or listed or out:
            raise Problem(
                "--dialects runs no mutant: remove --mutant, --quick, --every, --list, --out"
            )
        _prove_dialects(subject, options, jobs)
        return
    try:
        chosen = mutants(subject, options, mutant_ids)[::every]
    except KeyError as error:
        raise no_such_mutant(error.args[0], [m.name for m in mutants(subject)], role) from None
    if not chosen:
        raise _nothing_proved("none of these mutants violates a requirement of --only")
    if listed:
        for mutant in chosen:
            click.echo(_list_line(mutant))
        return
    progress = _Progress(len(chosen))
    with progress.bar:
        matrix = prove(
            subject,
            options,
            ids=mutant_ids,
            every=every,
            quick=quick,
            jobs=jobs,
            unmodified_ends=partial(_print_unmodified, subject),
            mutant_ends=progress.add,
        )
    _print_summary(matrix)
    if out:
        matrix.write(out)
    if matrix.survivors or not matrix.unmodified.good:
        raise SystemExit(ExitStatus.NONCONFORMANT)


def _print_unmodified(role: Role, results: Results) -> None:
    text = "unmodified {role}: {verdict}, {count} cases"
    label = UserMessage(results.verdict.value.replace("-", " "))
    role_name = UserMessage(role.value)
    click.echo(localized(text, role=role_name, verdict=label, count=len(results.cases)))


def _print_summary(matrix: "KillMatrix") -> None:
    """Print the mutants that survived, the cases that killed none, and the counts."""
    for proof in matrix.survivors:
        violated = ", ".join(proof.requirements)
        text = "SURVIVED {mutant}: {sentence} ({violated})"
        click.echo(localized(text, mutant=proof.fault, sentence=proof.sentence, violated=violated))
    for case in matrix.idle:
        click.echo(localized("kills no mutant: {case}", case=case))
    click.echo(
        localized(
            "{killed} of {faults} mutants killed, {subtle_killed} of {subtle} subtle ones",
            **{name: matrix.counts[name] for name in _KILLED},
        )
    )
    for name, what in (
        ("one_cause", "all failures are one group"),
        ("named_first", "the first line names a requirement that the mutant violates"),
    ):
        share = matrix.counts[name] / matrix.counts["faults"]
        count = f"{matrix.counts[name]}"
        text = "{what}: {count} mutants ({percent:.0f}%)"
        click.echo(localized(text, what=UserMessage(what), count=count, percent=100 * share))


_KILLED: Final = ("killed", "faults", "subtle_killed", "subtle")
"""The counts of the summary."""


def _nothing_proved(reason: str) -> SystemExit:
    click.echo(localized("nothing proved: {reason}", reason=localized(reason)), err=True)
    return SystemExit(ExitStatus.NOTHING_TESTED)


def _requirements(only: str | None) -> frozenset[str] | None:
    try:
        return frozenset(r.id for r in select(only)) if only else None
    except UnknownRequirementError as error:
        raise Problem(UserMessage("--only: {error}", error=error)) from None


def _list_line(mutant: "Mutant[Any]") -> str:
    """Return the id, the sentence, the violated requirements and the readings in one line."""
    facts: str = ", ".join(mutant.requirements)
    if mutant.reading:
        readings = ", ".join(mutant.reading)
        facts = UserMessage("{violated} under {readings}", violated=facts, readings=readings)
    if mutant.subtle:
        facts = UserMessage("{facts}; subtle", facts=facts)
    return localized(
        "{mutant}: {sentence} ({facts})",
        mutant=mutant.name,
        sentence=mutant.sentence,
        facts=facts,
    )


def _prove_dialects(role: Role, options: Options, jobs: int) -> None:
    """Show that no case fails a conforming implementation, whichever readings it follows."""
    from scaraspec.api.proving import prove_dialects  # noqa: PLC0415 - imports all mutants
    from scaraspec.mutants.kill_matrix import dialects  # noqa: PLC0415 - for the same reason

    if not collect(options, role):
        raise _nothing_proved("no case tests a requirement of --only")
    count = len(list(dialects()))
    number = itertools.count(1)

    def show(alarm: "Alarm") -> None:
        click.echo(f"{next(number)}/{count} {alarm.verdict} {' '.join(alarm.readings)}")
        for case, message in alarm.cases.items():
            click.echo(f"    {case}: {localized(message)}")

    alarms = prove_dialects(role, options, jobs=jobs, dialect_ends=show)
    passed = sum(not alarm.false for alarm in alarms)
    text = "{passed} of {count} dialects without a failed or inconclusive case"
    click.echo(localized(text, passed=passed, count=count))
    if passed < count:
        raise SystemExit(ExitStatus.NONCONFORMANT)


class _Progress:
    """The progress of a proof: a bar on a terminal, lines elsewhere.

    Args:
        count: Number of mutants.
    """

    def __init__(self, count: int) -> None:
        self._count, self._number = count, 0
        self._console = Console()
        self.bar = ProgressBar(self._console, localized("proving"), count, TimeRemainingColumn())

    def add(self, proof: "Proof") -> None:
        """Show the result of a mutant."""
        self._number += 1
        self.bar.count_one(proof.fault)
        if not self._console.is_terminal:
            text = "{mutant}: killed by {cases}" if proof.killers else "{mutant}: not killed"
            text = localized(text, mutant=proof.fault, cases=", ".join(proof.killers))
            click.echo(f"{self._number}/{self._count} {text}")
