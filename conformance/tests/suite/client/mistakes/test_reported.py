"""Mistakes of clients in reports: another value than received, or part of it."""

from collections.abc import Callable, Mapping
from contextlib import closing
from typing import Any

import pytest

from scaraspec.client import AsyncClient, ClientCore, ClientError, LinkLost
from scaraspec.client.core import Event
from scaraspec.client.pending_operation import PendingOperation, ProgramListing
from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.client_run import MemoryClient
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.client.harness.adapter import ClientAdapter
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run

Try = Callable[..., Mapping[str, Verdict]]


class ReportsPartialList(ClientCore):
    """Reports a partial program list when the connection ends."""

    class _Half(ProgramListing):
        def fail(self, error: ClientError) -> None:
            if self._names and isinstance(error, LinkLost):
                self.settle(tuple(self._names))
            else:
                super().fail(error)

    def command(self, name: str, value: Any = None) -> PendingOperation:
        if name != "list_programs":
            return super().command(name, value)
        return self._Half(BY_NAME[name], value, self.dialect)


def test_a_partial_list_is_not_a_result(tried: Try) -> None:
    """A list without its last part is not a result."""
    assert tried(ReportsPartialList, "4.10/10.many")["4.10/10.many"] is Verdict.FAIL


class CutsTexts(ClientCore):
    """Truncates passwords and names of programs to nine bytes."""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        cut = value[:9] if name in ("login", "run_program", "delete_program") else value
        return super().command(name, cut)


def test_a_wrong_request_causes_no_timeout() -> None:
    """A wrong request is answered too, so that no timeout passes."""
    shell = type("Made", (AsyncClient,), {"core": CutsTexts})
    with closing(MemoryClient(shell, DEFAULT)) as access:
        only = frozenset({"4.1/1", "4.11/1", "4.15/1"})
        options = Options(only=only, allowed=ALL, examples=3)
        begun_s = access.now_s
        results = Run(ClientAdapter(access, Ics(), options)).results()
        assert access.now_s - begun_s < 1
    verdicts = {case.id: case.verdict for case in results.cases}
    for case in ("4.1/1.passwords", "4.11/1.names", "4.15/1.names"):
        assert verdicts[case] is Verdict.FAIL


class MissesChunks(ClientCore):
    """Takes each chunk for the error signal."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        none = Frame(C2A, BY_NAME["download_chunk"].opcode).encode()
        return super().feed(none if data[:2] == none[:2] else data, now_s)


def test_no_wait_after_a_reported_end() -> None:
    """The suite does not wait for a client that has reported the end of a download."""
    shell = type("Made", (AsyncClient,), {"core": MissesChunks})
    with closing(MemoryClient(shell, DEFAULT)) as access:
        options = Options(only=frozenset({"5.3/11"}), allowed=ALL, examples=3)
        begun_s = access.now_s
        results = Run(ClientAdapter(access, Ics(), options)).results()
        assert access.now_s - begun_s < 10
    printed = {case.id: case for case in results.cases}["5.3/11"]
    assert printed.verdict is Verdict.FAIL
    assert "did not answer the chunk" in printed.message
    assert "error" in printed.observed  # the report of the client


def misreads(name: str, data: bytes, other: str, taken: bytes) -> type[ClientCore]:
    """Return a client that takes one frame for another."""
    sent = Frame(C2A, BY_NAME[name].opcode, data).encode()
    read = Frame(C2A, BY_NAME[other].opcode, taken).encode()

    class Misreads(ClientCore):
        def feed(self, data: bytes, now_s: float) -> list[Event]:
            return super().feed(data.replace(sent, read), now_s)

    return Misreads


@pytest.mark.parametrize(
    "misread",
    [
        ("simulate_program", b"1", "run_program", b"1", "3/33.flag"),
        ("get_motor_temperatures", b"1", "set_default_program", b"1", "3/33.flag"),
        ("set_tool_coordinates", b"0", "set_tool_coordinates", b"0|05", "4/13.bare"),
        ("run_program", b"0|21", "run_program", b"0|1F", "4/13.unknown"),
        (
            *("get_gripper_center", b"1.001|-4.35|0.29", "get_gripper_center"),
            *(b"1.000|-4.34|0.28", "T/9.numbers"),
        ),
        ("get_analog_input", b"1|65535", "get_analog_input", b"1|-1", "4.33/4.values"),
        ("get_analog_input", b"1|0.125", "get_analog_input", b"0", "4.33/4.values"),
        ("upload_chunk", b"", "upload_chunk", b"1", "5.2/19.odd-answers"),
        (
            *("get_running_program", b"1|pro1.rob|08090809", "get_running_program"),
            *(b"1|pro1.rob|00000000", "T/9.running-program"),  # in octal
        ),
        (
            *("get_time", b"20080908090809", "get_time", b"20080908090808"),  # a second ago
            "T/9.time",
        ),
        ("get_default_program", b"a", "get_default_program", b"", "T/9.default-program"),
        ("upload_chunk", b"01", "upload_chunk", b"1", "5.2/19.odd-answers"),
        ("upload_chunk", b"\x01", "upload_chunk", b"1", "5.2/19.odd-answers"),
        ("upload_name", b"10", "upload_name", b"1", "5.2/19.odd-answers"),
        ("get_default_program", b"1.rob", "get_default_program", b".rob", "T/9.default-program"),
        *(
            ("list_programs", b"0|part[1].rob|{b}.rob|$c;d.rob|007|1e3", *read, "4.10/10.order")
            for read in (
                ("list_programs", b"0|part1.rob|{b}.rob|$c;d.rob|007|1e3"),
                ("list_programs", b"0|part[1].rob|b.rob|$c;d.rob|007|1e3"),
                ("list_programs", b"0|part[1].rob|{b}.rob|;d.rob|007|1e3"),
                ("list_programs", b"0|part[1].rob|{b}.rob|$c;d.rob|7|1e3"),
                ("list_programs", b"0|part[1].rob|{b}.rob|$c;d.rob|007|1000"),
            )
        ),
        ("get_default_program", b"007", "get_default_program", b"7", "T/9.default-program"),
        ("get_default_program", b"no", "get_default_program", b"", "T/9.default-program"),
        (
            *("get_default_program", b"pick and place.rob", "get_default_program", b"pick"),
            "T/9.default-program",
        ),
    ],
)
def test_a_wrong_report_is_detected(
    tried: Try, misread: tuple[str, bytes, str, bytes, str]
) -> None:
    """Another reply, code, time, name or number than the sent one is detected."""
    name, sent, other, taken, case = misread
    assert tried(misreads(name, sent, other, taken), case)[case] is Verdict.FAIL


class TakesCodesForDone(ClientCore):
    """Takes a final result that begins with 1 for a success."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        opcode = BY_NAME["run_program"].opcode
        code, done = (Frame(C2A, opcode, text, tagged=True).encode() for text in (b"12", b"11"))
        return super().feed(data.replace(code, done), now_s)


def test_a_code_in_place_of_a_result_is_not_a_success(tried: Try) -> None:
    assert tried(TakesCodesForDone, "4/9.stages")["4/9.stages"] is Verdict.FAIL


@pytest.mark.parametrize("reply", [b"1\n", b"true"])
def test_only_1_logs_in(tried: Try, reply: bytes) -> None:
    """A login reply that resembles 1 or true is not a success."""
    assert tried(misreads("login", reply, "login", b"1"), "4.1/8")["4.1/8"] is Verdict.FAIL


_UNDER_0E = ("get_motor_temperatures", "set_default_program")


class AssignsToOldest(ClientCore):
    """Assigns a reply with 0x0E to the older request, without looking at its fields (A-4.14-1)."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        setting = BY_NAME["set_default_program"]
        queries = [e.command.name for e in self._open if e.command.name in _UNDER_0E]
        if frame.opcode == setting.opcode and queries[:1] == [setting.name]:
            frame = frame._replace(data=frame.data[:1])
        return super()._dispatch(frame, now_s)


def test_temperatures_are_not_the_reply_to_a_setting(tried: Try) -> None:
    """Temperatures with 0x0E are not the reply to an older setting."""
    assert tried(AssignsToOldest, "4.14/4.both")["4.14/4.both"] is Verdict.FAIL
