"""Due: an answer that never comes is blamed for itself, and waited for in full only twice."""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.judge.requirements import select
from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller import mutants
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame
from scaraspec.suite.controller.harness.timeouts import ExpectedReply, TimeoutPolicy
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Session

Try = Callable[..., Any]

_FULL_S = 60.0


def ids(clauses: str) -> list[str]:
    """The requirements of some clauses."""
    return [requirement.id for requirement in select(clauses)]


def without_reply(name: str) -> type[ControllerCore]:
    """A controller that never answers one command."""

    class Mute(ControllerCore):
        def handle(self, session: Session, frame: Frame, now_s: float) -> None:
            if frame.opcode != BY_NAME[name].opcode:
                super().handle(session, frame, now_s)

    return Mute


@pytest.mark.parametrize(
    "due", [ExpectedReply("get_version"), ExpectedReply("run_program", result=True)]
)
def test_what_never_came_is_waited_for_in_full_twice(due: ExpectedReply) -> None:
    """Once it has come it is always worth its time."""
    patience = TimeoutPolicy()
    for _ in range(2):
        assert patience.timeout_s(due, _FULL_S) == _FULL_S
        patience.note_timeout(due)
    assert patience.timeout_s(due, _FULL_S) < _FULL_S
    assert patience.timeout_s(due, 0.1) == 0.1
    patience.note_received(due)
    assert patience.timeout_s(due, _FULL_S) == _FULL_S
    patience.note_timeout(due)
    patience.note_timeout(due)
    assert not patience.given_up(due)


def test_rest_is_awaited_in_full_until_that_was_twice_in_vain() -> None:
    """A robot that came to rest late, once, is worth waiting for again."""
    patience = TimeoutPolicy()
    patience.note_rest(_FULL_S, rests=False)
    patience.note_rest(0.1, rests=True)
    assert patience.rest_timeout_s(_FULL_S) == _FULL_S
    patience.note_rest(_FULL_S, rests=False)
    assert patience.rest_timeout_s(_FULL_S) < _FULL_S
    patience.note_rest(20.0, rests=True)
    assert patience.rest_timeout_s(_FULL_S) == _FULL_S


def test_an_unanswered_query_fails_for_itself(tried: Try) -> None:
    """The cases that ask anything at all leave it out, once it was missed by itself twice."""
    results = tried(
        without_reply("get_motor_temperatures"), *ids("2,3/24,4.14,4.20/3,4/15,T"), examples=20
    )
    assert results.failed <= {"2/5", "2/6", "3/31", "4.14/2", "4.14/3"}
    assert "3/31" in results.failed
    assert {results[case].verdict for case in ("2/6", "3/24", "T/1")} == {Verdict.PASS}
    assert sum(case.duration_s for case in results.values()) < 200


def test_unanswered_deletions_fail_no_case_that_only_cleans_up(tried: Try) -> None:
    """What a case has made then stays; that it does is no failure of every case."""
    results = tried(without_reply("delete_program"), *ids("5.1,5.2/2,5.2/3,5.2/14,5.2/16"))
    assert {"3/31"} <= results.failed <= {"3/31", "4.11/3"}
    assert {results[case].verdict for case in ("5.1/1", "5.1/8", "5.2/3.elsewhere")} == {
        Verdict.PASS
    }


def test_a_move_without_a_result_fails_for_itself(tried: Try) -> None:
    """Where a move is but a means, its end is seen by the status."""
    results = tried(mutants()["move-has-no-result"].wrong, *ids("4.8,4.15,4.23,4.24"))
    assert results.failed == {"3/18", "4.24/6"}
    assert sum(case.duration_s for case in results.values()) < 500


def test_results_without_a_tag_answer_no_later_request(tried: Try) -> None:
    """They would be refusals of commands that were asked for long after them."""
    results = tried(mutants()["forgets-the-tag"].wrong, "3/12", "3/18", "4.15/4", "4.15/5")
    assert {"3/12", "4.15/5"} <= results.failed
    assert not [case for case in results.values() if "refused by a robot" in case.message]


def test_results_without_a_tag_hide_nothing_of_programs(tried: Try) -> None:
    """Once they have been awaited in vain, what has no tag ends a program in all other cases."""
    results = tried(mutants()["run-ends-untagged"].wrong, "4.15/5", *ids("6.4/5,6.5,6.6a"))
    assert results["4.15/5"].verdict is Verdict.FAIL
    assert results.failed == {"3/12", "4.15/5"}


def test_a_program_is_stopped_whatever_the_status_says(tried: Try) -> None:
    """A robot that says that it is idle while a program runs is not left running."""
    results = tried(mutants()["idle-during-run"].wrong, *ids("4.8,4.9,4.16"))
    assert "4.8/4" in results.failed
    assert not {"4/15", "4.16/2", "4.16/3"} & results.failed
    assert "run.restore" not in results
