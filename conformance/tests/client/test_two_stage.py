"""Two-stage commands: first reply, final result, and what an emergency stop does to both."""

from typing import Any

import pytest

from scaraspec.client.core import UnexpectedFrame
from scaraspec.client.errors import Failed, Interrupted, ProtocolError, Refused, ReplyTimeout
from scaraspec.protocol.commands import BY_NAME, COMMANDS
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.errors import TABLE_8_1, Joint
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import JogDirection

VALUES: dict[str, Any] = {
    "run_program": b"a.rob",
    "simulate_program": b"a.rob",
    "set_tool_coordinates": (60, 200, 300, 324, 34.6, 0, 0),
    "jog": JogDirection.PLUS_Y,
}
TWO_STAGE = [command for command in COMMANDS if command.two_stage]
REASONED = [command for command in TWO_STAGE if command.name != "emergency_stop"]


@pytest.fixture(params=TWO_STAGE, ids=lambda command: command.name)
def command(request: pytest.FixtureRequest) -> Any:
    """Each of the eight two-stage commands."""
    return request.param


def test_the_final_result_ends_the_command(play: Any, command: Any) -> None:
    """A-3-7: the first reply accepts it; the tagged frame ends it."""
    operation = play.ask(command.name, VALUES.get(command.name))
    play.receive_frame(command.opcode, b"1")
    assert operation.accepted
    assert not operation.settled
    play.receive_frame(command.opcode, b"11", tagged=True)
    assert operation.outcome() is None


def test_the_result_may_share_a_segment_with_the_reply(play: Any, command: Any) -> None:
    """First reply and final result arrive together (4/10)."""
    operation = play.ask(command.name, VALUES.get(command.name))
    reply, result = Frame(C2A, command.opcode, b"1"), Frame(C2A, command.opcode, b"11", tagged=True)
    play.receive_bytes(reply.encode() + result.encode())
    assert operation.outcome() is None


def test_the_result_may_take_hours(play: Any, command: Any) -> None:
    """4/11, A-3-15: no timeout, and other commands work during it (A-4-3)."""
    operation = play.ask(command.name, VALUES.get(command.name))
    play.receive_frame(command.opcode, b"1")
    play.wait_for(10)
    status = play.ask("get_status")
    play.receive_frame(0x09, b"01")
    assert status.outcome() == "01"
    play.wait_for(36000)
    assert not operation.settled
    play.receive_frame(command.opcode, b"11", tagged=True)
    assert operation.outcome() is None


def test_timeout_of_the_first_reply(play: Any, command: Any) -> None:
    """A-3-15; the client does not repeat the request (4/16)."""
    operation = play.ask(command.name, VALUES.get(command.name))
    play.wait_for(60)
    with pytest.raises(ReplyTimeout, match="it is unknown whether it took effect"):
        operation.outcome()
    assert [opcode for opcode, _ in play.sent()] == [command.opcode]


@pytest.mark.parametrize("data", [b"12", b"11|12", b"0|12", b"1", b"", b"11 "])
def test_an_invalid_result_is_not_a_success(play: Any, command: Any, data: bytes) -> None:
    """A-3-8: only ``11`` is a success."""
    operation = play.ask(command.name, VALUES.get(command.name))
    play.receive_frame(command.opcode, b"1")
    play.receive_frame(command.opcode, data, tagged=True)
    with pytest.raises(ProtocolError, match="final result of"):
        operation.outcome()


@pytest.mark.parametrize("case", [str.upper, str.lower])
@pytest.mark.parametrize("code", TABLE_8_1.values(), ids=lambda code: code.text)
def test_errors_have_the_meaning_of_the_code(play: Any, code: Any, case: Any) -> None:
    """4/12, 8/4, 8/6: as a refusal and as a failure, in either case, with the faulty joints."""
    text = case(code.text).encode()
    refused, failed = play.ask("reset"), play.ask("run_program", b"a.rob")
    play.receive_frame(0x33, b"0|" + text)
    play.receive_frame(0x30, b"1")
    play.receive_frame(0x30, b"00|" + text, tagged=True)
    with pytest.raises(Refused, match="reset was refused: ") as refusal:
        refused.outcome()
    with pytest.raises(Failed) as failure:
        failed.outcome()
    assert refusal.value.code == failure.value.code == code
    assert code.meaning in str(refusal.value)
    assert isinstance(failure.value, Interrupted) == (code.text == "00")
    assert code.text == "00" or code.meaning in str(failure.value)


def test_joints_of_a_code(play: Any) -> None:
    """8/4: 1A is 2 + 8."""
    reset = play.ask("reset")
    play.receive_frame(0x33, b"0|1A")
    assert reset.error.code.joints == (Joint.OUTER_ARM, Joint.ROTATION)


@pytest.mark.parametrize(("data", "code"), [(b"0", None), (b"0|7f", "7f"), (b"0 12", "12")])
def test_tolerated_forms_of_a_refusal(play: Any, data: bytes, code: str | None) -> None:
    """A-4.24-3 (bare 0), 4.8/11 (unknown codes), A-0-2 (a blank): nothing moved (4/13)."""
    move = play.ask("set_tool_coordinates", VALUES["set_tool_coordinates"])
    play.receive_frame(0x39, data)
    with pytest.raises(Refused) as caught:
        move.outcome()
    assert (caught.value.code and caught.value.code.text) == code
    assert isinstance(play.receive_frame(0x39, b"11", tagged=True)[0], UnexpectedFrame)


def stop(play: Any, *, first: bool = True) -> Any:
    """Start an emergency stop during a run, up to its first reply."""
    operation = play.ask("emergency_stop")
    play.receive_frame(0x32, b"1" if first else b"0")
    return operation


def test_emergency_stop_before_the_first_reply(play: Any) -> None:
    """A stop succeeds while the first reply to the run is missing (4.17/10)."""
    run = play.ask("run_program", b"a.rob")
    play.ask("get_status")
    halt = stop(play)
    play.receive_frame(0x32, b"11", tagged=True)
    assert halt.outcome() is None
    assert run.accepted is None


@pytest.mark.parametrize("order", ["first", "after", "none"])
def test_interrupted_result_before_after_or_never(play: Any, order: str) -> None:
    """A-4.17-4, 4.17/9: in all cases the stop succeeds and the run is interrupted."""
    run = play.ask("run_program", b"a.rob")
    play.receive_frame(0x30, b"1")
    halt = stop(play)
    if order == "first":
        play.receive_frame(0x30, b"00|00", tagged=True)
    play.receive_frame(0x32, b"11", tagged=True)
    if order == "after":
        play.wait_for(4)
        play.receive_frame(0x30, b"00|00", tagged=True)
    play.wait_for(5)
    assert halt.outcome() is None
    with pytest.raises(Interrupted, match="run_program was interrupted"):
        run.outcome()
    assert play.core.observed_readings["estop_interrupted"] == {order}
    again = play.ask("run_program", b"a.rob")
    play.receive_frame(0x30, b"1")
    play.receive_frame(0x30, b"11", tagged=True)
    assert again.outcome() is None


def test_a_stopped_jog_succeeds(play: Any) -> None:
    """A-4.17-4: a stop is its normal end, ``11``."""
    jog = play.ask("jog", JogDirection.MINUS_X)
    assert play.sent() == [(0x3D, b"4")]
    play.receive_frame(0x3D, b"1")
    stop(play)
    play.receive_frame(0x3D, b"11", tagged=True)
    assert jog.outcome() is None


@pytest.mark.parametrize("result", [None, b"00|12"])
def test_a_failed_stop_interrupts_nothing(play: Any, result: bytes | None) -> None:
    """After a refused or failed stop the run may still be executing."""
    run = play.ask("run_program", b"a.rob")
    play.receive_frame(0x30, b"1")
    halt = stop(play, first=result is not None)
    if result is not None:
        play.receive_frame(0x32, result, tagged=True)
    play.wait_for(3600)
    assert isinstance(halt.error, Failed if result else Refused)
    assert not run.settled


def test_a_stop_can_be_repeated(play: Any) -> None:
    """A stop can be sent again after its first reply, with or without a result."""
    first = stop(play)
    second = stop(play)
    play.receive_frame(0x32, b"11", tagged=True)
    assert isinstance(first.error, Interrupted)
    assert second.outcome() is None


def test_accepting_a_command_again_interrupts_the_first(play: Any) -> None:
    """FIRM A-4-2: none is accepted while one executes, so the first result was lost."""
    before = play.ask("run_program", b"a.rob")
    play.receive_frame(0x30, b"1")
    refused = play.ask("run_program", b"b.rob")
    play.receive_frame(0x30, b"0|01")
    assert isinstance(refused.error, Refused)
    assert not before.settled
    after = play.ask("run_program", b"b.rob")
    play.receive_frame(0x30, b"1")
    assert isinstance(before.error, Interrupted)
    play.receive_frame(0x30, b"11", tagged=True)
    assert after.outcome() is None


def test_shutdown_has_no_final_result(play: Any) -> None:
    """4.35: done with its ``1``; refused with a code."""
    done = play.ask("shutdown")
    play.receive_frame(0x60, b"1")
    assert done.outcome() is None
    refused = play.ask("shutdown")
    play.receive_frame(0x60, b"0|01")
    assert refused.error.code.text == "01"
    assert not BY_NAME["shutdown"].two_stage
