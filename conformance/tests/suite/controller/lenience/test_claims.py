"""Claims of a statement of conformance are believed, and held against what shows."""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import Network
from scaraspec.protocol.readings import DEFAULT
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, Carrier, Request

Try = Callable[..., Any]


class AppliesLater(ControllerCore):
    """A new network is told once the robot was restarted."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        settings = self.store.settings
        self._told = Network(settings.ip, settings.mask, settings.gateway)

    def get_network(self, _: Request) -> Network:
        """Tell the former one."""
        return self._told


def test_a_network_that_applies_after_a_restart_is_read_back_then(tried: Try) -> None:
    """The claim is believed, and verified with the hook."""
    claims = {"network_applies": "after-restart"}
    assert not tried(AppliesLater, "4.4/4", handled=("restart",), **claims).wrong


def test_a_network_that_applies_after_a_restart_cannot_be_verified_without_one(tried: Try) -> None:
    """Nothing is said of it then."""
    cases = tried(AppliesLater, "4.4/4", network_applies="after-restart")
    assert {case.verdict for case in cases.values()} == {Verdict.NONE}


def test_a_network_that_applies_late_unclaimed_is_a_failure(tried: Try) -> None:
    """What is not claimed is judged by the default."""
    assert tried(AppliesLater, "4.4/4")["4.4/4"].verdict is Verdict.FAIL


class Hurried(ControllerCore):
    """A simulator eight of whose seconds pass in one."""

    SCALE = 8

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        return super().open(connection, now_s * self.SCALE, link)

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        return super().receive(connection, data, now_s * self.SCALE)

    def close(self, connection: int, now_s: float) -> list[Action]:
        return super().close(connection, now_s * self.SCALE)

    def advance(self, now_s: float) -> list[Action]:
        return super().advance(now_s * self.SCALE)

    @property
    def next_event_s(self) -> float | None:
        event_s = super().next_event_s
        return None if event_s is None else event_s / self.SCALE


def test_a_simulator_may_be_faster(tried: Try) -> None:
    """Its seconds are shorter, also those that it waits for the rest of a frame."""
    dialect = DEFAULT.replace(xfer_timeout=f"{30 / Hurried.SCALE:g}")
    only = ["2/5", "2/12", "4.5/4", "4.6/2", "4.8/4", "4.9/2", "5.3/7", "6.5/20"]
    cases = tried(Hurried, *only, dialect=dialect, spoken=DEFAULT, time_scale=Hurried.SCALE)
    assert not cases.alarms


@pytest.mark.parametrize(
    ("served", "claimed", "right"),
    [("both", "both", True), ("both", "0x0D", True), ("both", "0x13", False)]
    + [("0x13", claimed, claimed == "0x13") for claimed in ("both", "0x0D", "0x13")],
)
def test_a_claim_of_opcodes_is_wrong_where_others_are_found(
    tried: Try, served: str, claimed: str, *, right: bool
) -> None:
    """A robot that is silent shows none until a program is the default one (A-4.12-2)."""
    spoken = DEFAULT.replace(op_get_default=served, default_none="silence")
    claims = {"dialect": spoken.replace(op_get_default=claimed), "claimed": {"op_get_default"}}
    assert not tried(ControllerCore, "2/7", spoken=spoken, **claims)
    cases = tried(ControllerCore, "4.12/5", spoken=spoken, **claims)
    assert ("claim.op_get_default" not in cases) is right


def test_the_printed_opcode_is_found_where_there_is_no_default(tried: Try) -> None:
    """Who serves 0x13 alone, and says nothing of none, shows it where one has been set."""
    spoken = DEFAULT.replace(op_get_default="0x13", default_none="silence")
    cases = tried(ControllerCore, "4.13/3", "4.20/3", spoken=spoken)
    assert cases.alarms == []
    assert cases.readings["op_get_default"].options == ("0x13",)


def test_one_client_may_be_served(tried: Try) -> None:
    """Where one connection is served, nobody looks from another at what undefined opcodes do."""
    cases = tried(ControllerCore, "3/21", spoken=DEFAULT.replace(max_clients="one"))
    assert cases.alarms == []


def test_an_opcode_that_may_be_unknown_proves_no_claim(tried: Try) -> None:
    """Without a default program the other opcode is answered 0, as an undefined one is (A-3-9)."""
    silent = DEFAULT.replace(on_unknown="0", op_get_default="0x13", default_none="silence")
    cases = tried(ControllerCore, "2/7", dialect=silent, claimed=frozenset(silent.differences()))
    assert not cases.wrong


def test_an_opcode_that_ends_the_connection_ends_no_case(tried: Try) -> None:
    """Which of the two asks for the default program is found out on any connection."""
    ends = DEFAULT.replace(on_unknown="close", op_get_default="0x13", default_none="silence")
    assert not tried(ControllerCore, "4.12/4", "4.13/3", dialect=ends).alarms


def test_silence_while_busy_is_claimed_rightly_though_a_reset_is_refused(tried: Try) -> None:
    """The refusal of a reset is drawn (L397), the others are not: the claim is of those."""
    silent = DEFAULT.replace(busy_reply="silence")
    for only in ("3/31", "4.18/2", "4.28/4"):
        assert not tried(
            ControllerCore, only, dialect=silent, claimed=frozenset({"busy_reply"})
        ).wrong


def test_a_claim_is_held_against_silence(tried: Try) -> None:
    """Who claims to refuse while it is busy, and is silent, has made a wrong claim."""
    claims = {"dialect": DEFAULT, "claimed": frozenset({"busy_reply"})}
    silent = DEFAULT.replace(busy_reply="silence")
    assert (
        tried(ControllerCore, "4/6", spoken=silent, **claims)["claim.busy_reply"].verdict
        is Verdict.FAIL
    )
    assert "claim.busy_reply" not in tried(ControllerCore, "4/6", **claims)


@pytest.mark.parametrize(
    ("key", "option", "requirement"),
    [
        ("text_encoding", "utf-8", "T/8"),  # which refuses names that are none
        ("empty_file", "name-only", "5.4/7"),  # which leaves one of an upload without a chunk
        ("busy_reply", "queue", "4.28/4"),  # which is silent at first
    ],
)
def test_a_claim_is_held_against_nothing_else(
    tried: Try, key: str, option: str, requirement: str
) -> None:
    """What a case makes of a refusal, or of a file that is left, contradicts no claim."""
    spoken = DEFAULT.replace(**{key: option})
    claimed = frozenset({key, "partial_keep"})
    made = tried(ControllerCore, requirement, spoken=spoken, dialect=spoken, claimed=claimed)
    assert not [case for case in made if case.startswith("claim.")]
