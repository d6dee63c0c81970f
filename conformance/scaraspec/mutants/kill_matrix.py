"""Proofs: what the suite finds of seeded faults, and that it fails no other dialect."""

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
"""Readings that fail: a blank for the bar (A-0-2), everything served before a login (A-4-4)."""

_ALARMING: Final = (Verdict.INCONCLUSIVE, Verdict.FAIL, Verdict.ERROR)


@dataclass(frozen=True, slots=True)
class Stand:
    """Where implementations of a role are tried.

    Attributes:
        faults: The seeded faults.
        prove: Runs the suite against one of them, or against none, in a dialect.
    """

    faults: Callable[[], Mapping[str, Mutant[Any]]]
    prove: Callable[..., Results]


STANDS: Final = {
    Role.CONTROLLER: Stand(controller_mutants.mutants, prove_controller),
    Role.CLIENT: Stand(client_mutants.mutants, prove_client),
}


@dataclass(frozen=True, slots=True)
class Proof:
    """What the suite found of one fault.

    Attributes:
        fault: Its name.
        sentence: What it does wrong.
        requirements: What it violates.
        subtle: Whether it shows only late, at an edge, in one state and the like.
        failures: Every case that failed, and its message.
        killers: Those that failed of a requirement that the fault violates.
    """

    fault: str
    sentence: str
    requirements: tuple[str, ...]
    subtle: bool
    failures: Mapping[str, str]
    killers: tuple[str, ...]

    def plain(self) -> dict[str, object]:
        """As JSON can hold it."""
        return asdict(self)


def proof_of(name: str, role: Role, options: Options, *, quick: bool) -> Proof:
    """Run the suite against a fault; a quick run tries only the cases of what it violates."""
    stand = STANDS[role]
    fault = stand.faults()[name]
    violated = frozenset(fault.requirements)
    if quick:
        options = replace(options, only=violated)
    failed = [case for case in stand.prove(options, fault).cases if case.verdict is Verdict.FAIL]
    return Proof(
        name,
        fault.sentence,
        fault.requirements,
        fault.subtle,
        {case.id: case.message for case in failed},
        tuple(case.id for case in failed if violated & set(case.requirements)),
    )


@dataclass(frozen=True, slots=True)
class Alarm:
    """What the suite says of a faultless implementation that follows other readings.

    Attributes:
        readings: Where it differs from the default, as ``key=option``.
        verdict: What the run amounts to.
        cases: Every case that is neither passed, tolerated nor left out, and its message.
    """

    readings: tuple[str, ...]
    verdict: str
    cases: Mapping[str, str]

    @property
    def false(self) -> bool:
        """Whether it is a false alarm."""
        return self.verdict != Conclusion.CONFORMANT.value


def alarm_of(dialect: Dialect, role: Role, options: Options) -> Alarm:
    """Run the suite against a faultless implementation of this dialect."""
    results = STANDS[role].prove(options, None, dialect)
    return Alarm(
        tuple(f"{key}={option}" for key, option in dialect.differences().items()),
        results.verdict.value,
        {case.id: case.message for case in results.cases if case.verdict in _ALARMING},
    )


def dialects() -> Iterator[Dialect]:
    """Every reading but the default by itself, then dialects in which every pair of them occurs.

    Without those which the register lists and calls wrong.
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
