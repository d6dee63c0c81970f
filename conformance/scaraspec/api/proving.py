"""The proof that the suite finds faults: mutants, and implementations in other dialects."""

import json
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from scaraspec.judge.verdicts import Conclusion
from scaraspec.mutants.kill_matrix import (
    ROLE_SUITES,
    Alarm,
    Proof,
    check_dialect,
    dialects,
    prove_mutant,
)
from scaraspec.mutants.registry import Mutant
from scaraspec.mutants.worker_pool import in_processes
from scaraspec.report.files import write_whole
from scaraspec.report.model import Results, Role
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.plan import ALL, Options

MATRIX: Final = "kill-matrix.{role}.json"
EVERYTHING: Final = Options(allowed=ALL, undefined=True, exhaustive=True)
"""Options of a proof: all hazards, as the implementations are simulated."""

_SLOWEST: Final = 10  # so many mutants are published with their durations
_RUNS: Final = 50  # per worker process: pytest and hypothesis keep some memory of each run


@dataclass(frozen=True, slots=True)
class KillMatrix:
    """Which cases kill which mutants.

    Attributes:
        role: The role of the mutants.
        quick: Whether each mutant met only the cases of the requirements that it violates.
        unmodified: The conclusion of the run against the implementation without a fault.
        proofs: One result for each mutant.
        cases: The ids of the cases that were run.
        idle: The cases that kill no mutant; empty if only some mutants were run.
    """

    role: Role
    quick: bool
    unmodified: Conclusion
    proofs: tuple[Proof, ...]
    cases: tuple[str, ...]
    idle: tuple[str, ...]

    @property
    def survivors(self) -> tuple[Proof, ...]:
        """The mutants that no case killed."""
        return tuple(proof for proof in self.proofs if not proof.killers)

    @property
    def counts(self) -> dict[str, int]:
        """The numbers of mutants and of killed mutants, in total and of the subtle ones.

        Also of the mutants whose failures are one group, and of those for which the first line of
        the report names a requirement that they violate.
        """
        killed = [(proof.subtle, bool(proof.killers)) for proof in self.proofs]
        return {
            "faults": len(killed),
            "killed": sum(dead for _, dead in killed),
            "subtle": sum(subtle for subtle, _ in killed),
            "subtle_killed": sum(subtle and dead for subtle, dead in killed),
            "one_cause": sum(proof.one_cause for proof in self.proofs),
            "named_first": sum(proof.named for proof in self.proofs),
        }

    @property
    def slowest(self) -> dict[str, float]:
        """The simulated durations of the mutants that took longest, in seconds."""
        longest = sorted(self.proofs, key=lambda proof: proof.duration_s, reverse=True)
        return {proof.fault: proof.duration_s for proof in longest[:_SLOWEST]}

    def write(self, folder: Path) -> None:
        """Write ``kill-matrix.ROLE.json`` into a folder, which is created if it is missing.

        Raises:
            OSError: The file cannot be written.
        """
        folder.mkdir(parents=True, exist_ok=True)
        matrix = {
            "role": self.role.value,
            "quick": self.quick,
            "without_fault": self.unmodified.value,
            "counts": {**self.counts, "cases": len(self.cases), "idle": len(self.idle)},
            "faults": [proof.plain() for proof in self.proofs],
            "idle": list(self.idle),
            "slowest": self.slowest,
        }
        text = json.dumps(matrix, ensure_ascii=False, indent=1) + "\n"
        write_whole(folder / MATRIX.format(role=self.role.value), text)


def mutants(
    role: Role, options: Options = EVERYTHING, ids: Sequence[str] = ()
) -> list[Mutant[Any]]:
    """Return the mutants of a role that violate a requirement of ``options.only``.

    Args:
        role: Controller or client.
        options: Options of the run.
        ids: Only these mutants; empty for all.

    Raises:
        KeyError: There is no mutant with one of the ids.
    """
    known = ROLE_SUITES[role].faults()
    chosen = [known[mutant_id] for mutant_id in ids] or [*known.values()]
    only = options.only
    names = {each.name for each in chosen if only is None or only & {*each.requirements}}
    return [mutant for mutant in known.values() if mutant.name in names]


def prove(  # noqa: PLR0913 - independent options of a proof
    role: Role = Role.CONTROLLER,
    options: Options = EVERYTHING,
    *,
    ids: Sequence[str] = (),
    every: int = 1,
    quick: bool = False,
    jobs: int = 1,
    unmodified_ends: Callable[[Results], None] = lambda _results: None,
    mutant_ends: Callable[[Proof], None] = lambda _proof: None,
) -> KillMatrix:
    """Run the suite against mutants of our controller or client, in several processes.

    The first run is against the implementation without a fault. If the mutants are named and the
    runs are quick, it has only the cases of the requirements that they violate.

    Args:
        role: Controller or client.
        options: Options of the runs; ``only`` also selects the mutants.
        ids: Only these mutants; empty for all.
        every: Only every Nth mutant.
        quick: Run only the cases of the requirements that each mutant violates.
        jobs: Number of processes.
        unmodified_ends: Called with the results of the implementation without a fault.
        mutant_ends: Called with the result of each mutant.

    Raises:
        KeyError: There is no mutant with one of the ids.
        KeyboardInterrupt: The user interrupted the run.
    """
    selected = mutants(role, options, ids)[::every]
    chosen = [mutant.name for mutant in selected]
    violated = frozenset(each for mutant in selected for each in mutant.requirements)
    only = violated if quick and ids else options.only
    unmodified = ROLE_SUITES[role].prove(replace(options, only=only))
    if any(case.id == "run.interrupted" for case in unmodified.cases):
        raise KeyboardInterrupt
    unmodified_ends(unmodified)
    proofs = []
    work = partial(prove_mutant, role=role, options=options, quick=quick)
    with closing(in_processes(work, chosen, jobs=jobs, runs=_RUNS)) as pending:
        for proof in pending:
            mutant_ends(proof)
            proofs.append(proof)
    cases = [case.id for case in collect(options, role) if not (options.brief and case.slow)]
    killers = {case for proof in proofs for case in proof.killers}
    idle = [case for case in cases if case not in killers] if not ids and every == 1 else []
    return KillMatrix(role, quick, unmodified.verdict, tuple(proofs), tuple(cases), tuple(idle))


def prove_dialects(
    role: Role = Role.CONTROLLER,
    options: Options = EVERYTHING,
    *,
    jobs: int = 1,
    dialect_ends: Callable[[Alarm], None] = lambda _alarm: None,
) -> tuple[Alarm, ...]:
    """Run the suite against the unmodified implementation in each reading, and in every pair.

    Args:
        role: Controller or client.
        options: Options of the runs.
        jobs: Number of processes.
        dialect_ends: Called with the result of each dialect.
    """
    alarms = []
    work = partial(check_dialect, role=role, options=options)
    with closing(in_processes(work, list(dialects()), jobs=jobs, runs=_RUNS)) as pending:
        for alarm in pending:
            dialect_ends(alarm)
            alarms.append(alarm)
    return tuple(alarms)
