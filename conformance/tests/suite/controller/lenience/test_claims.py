"""Claims of the ICS are used as expectations, and are compared with the observed readings."""

from collections.abc import Callable
from typing import Any

import pytest
from fast_simulator import FastSimulator

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import Network
from scaraspec.protocol.readings import DEFAULT
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

RunCases = Callable[..., Any]


class AppliesNetworkAfterRestart(ControllerCore):
    """A new network is reported only after a restart."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        settings = self.store.settings
        self._reported = Network(settings.ip, settings.mask, settings.gateway)

    def get_network(self, _: Request) -> Network:
        return self._reported


def test_network_after_restart_is_verified_with_the_hook(run_cases: RunCases) -> None:
    """With the claim and the hook, the network is read after a restart."""
    claims = {"network_applies": "after-restart"}
    assert not run_cases(
        AppliesNetworkAfterRestart, "4.4/4", hooks=("restart",), **claims
    ).not_passed


def test_network_after_restart_is_skipped_without_the_hook(run_cases: RunCases) -> None:
    """With the claim and without the hook, the case is skipped."""
    cases = run_cases(AppliesNetworkAfterRestart, "4.4/4", network_applies="after-restart")
    assert {case.verdict for case in cases.values()} == {Verdict.NONE}


def test_network_after_restart_fails_without_the_claim(run_cases: RunCases) -> None:
    """Without the claim, the default applies."""
    assert run_cases(AppliesNetworkAfterRestart, "4.4/4")["4.4/4"].verdict is Verdict.FAIL


def test_a_simulator_may_be_faster(run_cases: RunCases) -> None:
    """With `time_scale`, all durations are shorter, including the wait for the rest of a frame."""
    dialect = DEFAULT.replace(xfer_timeout=f"{30 / FastSimulator.SCALE:g}")
    only = ["2/5", "2/12", "4.5/4", "4.6/2", "4.8/4", "4.9/2", "5.3/7", "6.5/20"]
    cases = run_cases(
        FastSimulator, *only, dialect=dialect, actual=DEFAULT, time_scale=FastSimulator.SCALE
    )
    assert not cases.problems


@pytest.mark.parametrize(
    ("served", "claimed", "right"),
    [("both", "both", True), ("both", "0x0D", True), ("both", "0x13", False)]
    + [("0x13", claimed, claimed == "0x13") for claimed in ("both", "0x0D", "0x13")],
)
def test_wrong_claim_of_opcodes_is_found(
    run_cases: RunCases, served: str, claimed: str, *, right: bool
) -> None:
    """A silent robot shows its opcodes only if there is a default program (A-4.12-2)."""
    actual = DEFAULT.replace(op_get_default=served, default_none="silence")
    claims = {"dialect": actual.replace(op_get_default=claimed), "claimed": {"op_get_default"}}
    assert not run_cases(ControllerCore, "2/7", actual=actual, **claims)
    cases = run_cases(ControllerCore, "4.12/5", actual=actual, **claims)
    assert ("claim.op_get_default" not in cases) is right


def test_printed_opcode_is_found_after_setting_a_default(run_cases: RunCases) -> None:
    """A robot that serves only 0x13 shows it after a default program is set."""
    actual = DEFAULT.replace(op_get_default="0x13", default_none="silence")
    cases = run_cases(ControllerCore, "4.13/3", "4.20/3", actual=actual)
    assert cases.problems == []
    assert cases.readings["op_get_default"].options == ("0x13",)


def test_one_client_may_be_served(run_cases: RunCases) -> None:
    """If one connection is served, no second one observes the effect of undefined opcodes."""
    cases = run_cases(ControllerCore, "3/21", actual=DEFAULT.replace(max_clients="one"))
    assert cases.problems == []


def test_reply_to_an_unknown_opcode_does_not_contradict_the_claim(run_cases: RunCases) -> None:
    """Without a default program, the other opcode is answered 0 like an undefined one (A-3-9)."""
    silent = DEFAULT.replace(on_unknown="0", op_get_default="0x13", default_none="silence")
    cases = run_cases(
        ControllerCore, "2/7", dialect=silent, claimed=frozenset(silent.differences())
    )
    assert not cases.not_passed


def test_closed_connection_after_the_other_opcode(run_cases: RunCases) -> None:
    """If the other opcode of the default program closes the connection, no case fails."""
    ends = DEFAULT.replace(on_unknown="close", op_get_default="0x13", default_none="silence")
    assert not run_cases(ControllerCore, "4.12/4", "4.13/3", dialect=ends).problems


def test_claim_of_silence_while_busy_excludes_the_reset(run_cases: RunCases) -> None:
    """The document states the refusal of a reset (L397): the claim is about the others."""
    silent = DEFAULT.replace(busy_reply="silence")
    for only in ("3/31", "4.18/2", "4.28/4"):
        assert not run_cases(
            ControllerCore, only, dialect=silent, claimed=frozenset({"busy_reply"})
        ).not_passed


def test_silence_contradicts_the_claim_of_refusals(run_cases: RunCases) -> None:
    """A busy robot that claims refusals and does not reply contradicts its claim."""
    claims = {"dialect": DEFAULT, "claimed": frozenset({"busy_reply"})}
    silent = DEFAULT.replace(busy_reply="silence")
    assert (
        run_cases(ControllerCore, "4/6", actual=silent, **claims)["claim.busy_reply"].verdict
        is Verdict.FAIL
    )
    assert "claim.busy_reply" not in run_cases(ControllerCore, "4/6", **claims)


@pytest.mark.parametrize(
    ("key", "option", "requirement"),
    [
        ("text_encoding", "utf-8", "T/8"),  # it refuses names in other encodings
        ("empty_file", "name-only", "5.4/7"),  # an upload without a chunk leaves a file
        ("busy_reply", "queue", "4.28/4"),  # it does not reply at first
    ],
)
def test_tolerated_behaviour_does_not_contradict_a_claim(
    run_cases: RunCases, key: str, option: str, requirement: str
) -> None:
    """A refusal or a remaining file that a case tolerates contradicts no claim."""
    actual = DEFAULT.replace(**{key: option})
    claimed = frozenset({key, "partial_keep"})
    cases = run_cases(ControllerCore, requirement, actual=actual, dialect=actual, claimed=claimed)
    assert not [case for case in cases if case.startswith("claim.")]
