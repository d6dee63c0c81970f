"""A subject with two faults has two causes: groups of failures are not too large."""

from dataclasses import replace

from scaraspec.mutants.controller import mutants
from scaraspec.mutants.controller_run import prove_controller
from scaraspec.suite.engine.plan import ALL, Options


def test_two_faults_have_two_causes() -> None:
    """Each group has only the failures of one fault."""
    first, second = mutants()["time-with-two-digits-of-the-year"], mutants()["any-password-opens"]
    both = replace(first, wrong=type("Both", (first.wrong, second.wrong), {}))
    only = frozenset(first.requirements + second.requirements)
    causes = prove_controller(Options(only=only, allowed=ALL, examples=1), both).causes
    assert len(causes) == 2
    assert all(len({r in first.requirements for r in c.requirements}) == 1 for c in causes)
    named = {requirement for cause in causes for requirement in cause.requirements}
    assert not named.isdisjoint(first.requirements)
    assert not named.isdisjoint(second.requirements)
