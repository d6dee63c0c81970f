"""Kill matrix: which cases fail for which mutant, and whether a case fails another dialect."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

from allpairspy import AllPairs  # type: ignore[import-untyped] # it ships no types

from scaraspec.judge.verdicts import Conclusion, Verdict
from scaraspec.mutants import client as client_mutants
from scaraspec.mutants import controller as controller_mutants
from scaraspec.mutants.client_run import prove_client
from scaraspec.mutants.controller_run import prove_controller
from scaraspec.mutants.registry import Mutant
from scaraspec.protocol.readings import READINGS, Dialect
from scaraspec.report.model import Results, Role
from scaraspec.suite.engine.plan import Options

_WRONG: Final = frozenset({("err_sep", "space"), ("prelogin", "all")})
"""Readings that fail: a space as the separator (A-0-2), all commands before a login (A-4-4)."""

_NS: Final = 1e9

_ALARMING: Final = (Verdict.INCONCLUSIVE, Verdict.FAIL, Verdict.ERROR)


@dataclass(frozen=True, slots=True)
class RoleSuite:
    """How the implementations of a role are tested.

    Attributes:
        faults: Returns the mutants by id.
        prove: Runs the suite against a mutant, or the unmodified implementation, in a dialect.
    """

    faults: Callable[[], Mapping[str, Mutant[Any]]]
    prove: Callable[..., Results]


ROLE_SUITES: Final = {
    Role.CONTROLLER: RoleSuite(controller_mutants.mutants, prove_controller),
    Role.CLIENT: RoleSuite(client_mutants.mutants, prove_client),
}


@dataclass(frozen=True, slots=True)
class Proof:
    """The result of the suite against one mutant.

    Attributes:
        fault: The mutant id.
        sentence: What the mutant does wrong.
        requirements: The requirements that it violates.
        subtle: Whether the fault shows only in few situations; see `registry.Mutant`.
        failures: The message of each case that failed.
        killers: The failed cases of the requirements that the mutant violates.
        causes: The number of groups of failures; see `report.root_causes`.
        first: The requirements that the first line of the report names.
        duration_s: The duration of the run in simulated time, in seconds.
    """

    fault: str
    sentence: str
    requirements: tuple[str, ...]
    subtle: bool
    failures: Mapping[str, str]
    killers: tuple[str, ...]
    causes: int
    first: tuple[str, ...]
    duration_s: float

    @property
    def one_cause(self) -> bool:
        """Whether all failures are one group."""
        return self.causes == 1

    @property
    def named(self) -> bool:
        """Whether the first line of the report names a requirement that the mutant violates."""
        return not set(self.first).isdisjoint(self.requirements)

    def plain(self) -> dict[str, object]:
        """Return the fields as a dictionary for JSON."""
        return asdict(self)


def prove_mutant(name: str, role: Role, options: Options, *, quick: bool) -> Proof:
    """Run the suite against a mutant; `quick` runs only cases of the violated requirements."""
    suite = ROLE_SUITES[role]
    fault = suite.faults()[name]
    violated = frozenset(fault.requirements)
    if quick:
        options = replace(options, only=violated)
    results = suite.prove(options, fault)
    assert results.run is not None, "the results of a run state its times"
    failed = [case for case in results.cases if case.verdict is Verdict.FAIL]
    return Proof(
        name,
        fault.sentence,
        fault.requirements,
        fault.subtle,
        {case.id: case.message for case in failed},
        tuple(case.id for case in failed if violated & set(case.requirements)),
        len(results.causes),
        results.causes[0].requirements if results.causes else (),
        duration_s=round((results.run.ended_ns - results.run.begun_ns) / _NS, 1),
    )


@dataclass(frozen=True, slots=True)
class Alarm:
    """The result of the suite against the unmodified implementation in another dialect.

    Attributes:
        readings: The readings that differ from the default, as ``key=option``.
        verdict: The conclusion of the run.
        cases: The message of each case that failed, had an error or was inconclusive.
    """

    readings: tuple[str, ...]
    verdict: str
    cases: Mapping[str, str]

    @property
    def false(self) -> bool:
        """Whether the suite found a violation or could not decide."""
        return not Conclusion(self.verdict).good


def check_dialect(dialect: Dialect, role: Role, options: Options) -> Alarm:
    """Run the suite against the unmodified implementation in this dialect."""
    results = ROLE_SUITES[role].prove(options, None, dialect)
    return Alarm(
        tuple(f"{key}={option}" for key, option in dialect.differences().items()),
        results.verdict.value,
        {case.id: case.message for case in results.cases if case.verdict in _ALARMING},
    )


def dialects() -> Iterator[Dialect]:
    """Yield each reading other than the default, then dialects that cover every pair of readings.

    Readings that the register lists as wrong are skipped.
    """
    several = {
        key: names
        for key, reading in READINGS.items()
        if len(names := [o.name for o in reading.options if (key, o.name) not in _WRONG]) > 1
    }
    for key, (_, *others) in several.items():
        for name in others:
            yield Dialect({key: name})
    for names in AllPairs(list(several.values())):
        yield Dialect(dict(zip(several, names, strict=True)))
