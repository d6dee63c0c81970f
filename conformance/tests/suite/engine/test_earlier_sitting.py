"""A run continues an earlier one only if nothing differs that can change a verdict."""

from dataclasses import replace
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller_run import PASSWORD, Robot
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import SEEN, ReadingSeen, Results, Role
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.earlier_sitting import cases_to_repeat, date_of, difference
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.run import Run
from scaraspec.user_message import UserMessage
from scaraspec.virtual_controller.core import ControllerCore

ICS = Ics(name="Plant A", version="1.2")
OPTIONS = Options(frozenset({"4.7/2", "4.8/2"}))


def adapter(ics: Ics = ICS, options: Options = OPTIONS, **access: Any) -> ControllerAdapter:
    """The adapter of a run against the virtual controller in memory."""
    network = Robot(ControllerCore, DEFAULT).network
    return ControllerAdapter(MemoryAccess(network, **access), ics, PASSWORD, options)


@pytest.fixture(scope="module")
def first() -> Results:
    """The results of an earlier run, as they are read from a file."""
    return Results.from_json(Run(adapter()).results().to_json())


def test_the_same_run(first: Results) -> None:
    """The link and the required coverage may differ, because they change no verdict."""
    options = replace(OPTIONS, required=frozenset({"4.8/2"}), required_percent=50.0)
    assert difference(first, replace(adapter(options=options), link="elsewhere")) == ""


@pytest.mark.parametrize(
    ("ics", "options", "expected_text"),
    [
        ({"name": "Plant B"}, {}, "subject.name was Plant A and is Plant B"),
        ({"version": ""}, {}, "subject.version was 1.2 and is not given"),
        ({"unsupported": frozenset({"jog"})}, {}, "lacks was not given and is jog"),
        ({"claimed": frozenset({"endian"})}, {}, "readings.endian was not given and is little"),
        ({"dialect": DEFAULT.replace(reply_timeout="8")}, {}, "reply_timeout_s was 5 and is 8"),
        ({"dialect": DEFAULT.replace(xfer_timeout="1")}, {}, "transfer_timeout_s was 30 and is 1"),
        ({"time_scale": 8.0}, {}, "time_scale was 1 and is 8"),
        ({}, {"allowed": frozenset({Hazard.STATE})}, "allow was not given and is state"),
        ({}, {"undefined": True}, "undefined_opcodes was false and is true"),
        ({}, {"examples": 5}, "examples was 20 and is 5"),
        ({}, {"exhaustive": True}, "exhaustive was false and is true"),
        ({}, {"seed": 3}, "seed was 0 and is 3"),
        ({}, {"only": None}, "only was 4.7/2,4.8/2 and is not given"),
        ({}, {"only": frozenset({f"4.{n}/2" for n in range(1, 20)})}, "4.1/2,4.10/2"),
    ],
)
def test_differences_that_change_a_verdict(
    first: Results, ics: dict[str, Any], options: dict[str, Any], expected_text: str
) -> None:
    """The message names the difference, in less than two lines."""
    found = difference(first, adapter(replace(ICS, **ics), replace(OPTIONS, **options)))
    assert expected_text in found
    assert len(found) < 160


def test_other_timeouts_and_suites(first: Results) -> None:
    """Another wait limit, another version of the suite, and results of schema 1."""
    assert difference(first, adapter(wait_limit_s=5.0)) == "patience_s was inf and is 5"
    old = replace(first, tool=replace(first.tool, version="0.0.9"))
    assert "version of scaraspec was 0.0.9 and is" in difference(old, adapter())
    assert difference(replace(first, run=None), adapter()) == (
        "only was not given and is 4.7/2,4.8/2"
    )
    assert difference(replace(first, role=Role.CLIENT), adapter()).startswith("role was client")


def continued(earlier: Results, *, end_at: str = "") -> tuple[Results, list[str]]:
    """Continue a run; return the results and the ids of the cases that ran.

    Args:
        earlier: The results of the earlier run.
        end_at: The user ends the run when this case begins.
    """
    ran: list[str] = []

    def announce(case: Case) -> None:
        if case.id == end_at:
            raise KeyboardInterrupt
        ran.append(case.id)

    return Run(adapter(), earlier=earlier, announce=announce).results(), ran


def test_earlier_results_are_kept(first: Results) -> None:
    """Verdicts, findings, wrong claims, readings and counts of the earlier run are kept."""
    failed = replace(first.cases[0], verdict=Verdict.FAIL)
    seen = replace(failed, id=f"4.8/2{SEEN}1")
    claim = replace(failed, id="claim.endian", requirements=())
    reading = ReadingSeen(("little",), default=False, mixed=False)
    earlier = replace(
        first,
        cases=(failed, *first.cases[1:], seen, claim),
        readings={"controller": {"estop_interrupted": reading}},
        undecided={"3/31": 2},
    )
    results, ran = continued(earlier)
    assert not ran
    date = date_of(first)
    assert date.startswith("2026-01-01T00:00:")
    assert {replace(case, date=date) for case in earlier.cases} <= set(results.cases)
    assert results.readings["controller"]["estop_interrupted"] == reading
    assert results.undecided == {"3/31": 2}


def test_an_interruption_keeps_earlier_results(first: Results) -> None:
    """A case that the earlier run has completed stays, although this run did not reach it."""
    *_, last = first.cases
    (missing,) = {case.id for case in first.cases} - {last.id}
    earlier = replace(first, cases=(last,))
    results, ran = continued(earlier, end_at=missing)
    assert not ran
    assert replace(last, date=date_of(first)) in results.cases


def test_cases_to_repeat(first: Results) -> None:
    """Failed, inconclusive and missing cases, and those of a failure that the judge found."""
    planned = collect(OPTIONS)
    assert cases_to_repeat(first, planned) == frozenset()
    failed, missing = first.cases
    for verdict in (Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.ERROR, Verdict.NONE):
        changed = replace(first, cases=(replace(failed, verdict=verdict), missing))
        assert cases_to_repeat(changed, planned) == {failed.id}
    assert cases_to_repeat(replace(first, cases=(failed,)), planned) == {missing.id}
    message = UserMessage.joined("wrong", "; first seen in case {first_case}", first_case=failed.id)
    seen = replace(
        failed, id=f"3/31{SEEN}1", requirements=("3/31",), verdict=Verdict.FAIL, message=message
    )
    assert cases_to_repeat(replace(first, cases=(*first.cases, seen)), planned) == {failed.id}
    seen = replace(seen, requirements=missing.requirements, message="wrong")
    assert cases_to_repeat(replace(first, cases=(*first.cases, seen)), planned) == {missing.id}
