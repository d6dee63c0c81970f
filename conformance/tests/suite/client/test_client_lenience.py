"""Clients that use the freedom of the document differently from the reference client pass."""

import asyncio
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from contextlib import suppress
from datetime import datetime
from ipaddress import IPv4Address, IPv4Network
from pathlib import Path
from typing import Any, TypeVar

import pytest

from scaraspec.client import (
    AsyncClient,
    ClientCore,
    ClientError,
    ProtocolError,
    Refused,
    ReplyTimeout,
)
from scaraspec.client.core import Event, UnexpectedFrame
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.client.results import RunningProgram, Status
from scaraspec.client.transfer import Upload
from scaraspec.judge.requirements import select
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import (
    BY_NAME,
    JointValues,
    MoveTarget,
    Network,
    PasswordChange,
    Point,
    Pose,
)
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.errors import RESERVED, lookup
from scaraspec.protocol.frames import Frame, Skipped, StreamItem
from scaraspec.protocol.readings import DEFAULT
from scaraspec.protocol.transfer import FILE_DATA, Chunk
from scaraspec.report.model import Case

T = TypeVar("T")
Certified = Callable[..., tuple[Case, ...]]
Defect = Callable[..., dict[str, str]]
ONLY = frozenset(
    r.id for r in select("2,3,T,4.1,4.2,4.3,4.4,4.5,4.6,4.7,4.8,4.9,4.10,4.11,4.12,4.13,4.14")
)
GOOD = (Verdict.PASS, Verdict.TOLERATED)


class Flushes(ClientCore):
    """Drops everything that arrives with invalid bytes (A-3-10)."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        items = list(found)
        bad = any(isinstance(item, Skipped) for item in items)
        return super()._process_items([] if bad else items, now_s)


class GivesUp(ClientCore):
    """Aborts its operations when an unexpected frame or invalid bytes arrive."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        events = super().feed(data, now_s)
        if any(isinstance(event, Skipped) or self.is_odd(event) for event in events):
            for operation in tuple(self._open):
                operation.fail(ProtocolError("what is that?"))
                events += self._after_step(operation, now_s)
        return events

    @staticmethod
    def is_odd(event: Event) -> bool:
        return isinstance(event, UnexpectedFrame) and not event.frame.tagged


class RefusesLongNames(ClientCore):
    """Accepts names of at most 30 bytes, and passwords of at most 32."""

    def command(self, name: str, value: Any = None) -> Any:
        if isinstance(value, bytes) and len(value) > (32 if name == "login" else 30):
            raise ClientError("too long")
        return super().command(name, value)


class Ceaseless(AsyncClient, ABC):
    """Repeats an action from its login on."""

    pause_s = 0.1
    _doing: asyncio.Task[None] | None = None

    @abstractmethod
    async def once(self) -> None:
        """The repeated action."""

    async def connect(self) -> None:
        await super().connect()
        self._doing = asyncio.get_running_loop().create_task(self._go_on())

    async def close(self) -> None:
        if self._doing:
            self._doing.cancel()
        await super().close()

    async def _go_on(self) -> None:
        while True:
            with suppress(ClientError):
                await self.once()
            await asyncio.sleep(self.pause_s)


class AutoResponder(Ceaseless):
    """Polls status, coordinates and inputs ten times a second."""

    async def once(self) -> None:
        await self.get_status()
        await self.get_tool_coordinates()
        await self.get_digital_inputs()
        await self.get_analog_input(3)


class TakesNamesFromLists(ClientCore):
    """Requires the bar after the flag of a list (A-4.10-2)."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.opcode == 0x0B and frame.data[1:2] not in (b"", b"|"):
            frame = frame._replace(data=b"?")
        return super()._dispatch(frame, now_s)


class HasHabits(Flushes, RefusesLongNames, TakesNamesFromLists):
    """Combines three independent habits."""


@pytest.mark.parametrize("make", [HasHabits, GivesUp])
def test_no_false_alarm(wrong: Defect, make: type[ClientCore]) -> None:
    """No case fails."""
    assert not wrong(make, ONLY)


def test_fetched_parts(wrong: Defect) -> None:
    """A client that requests each part of a list gets it then (A-4.10-3 b)."""
    dialect = DEFAULT.replace(list_cont="request")
    assert not wrong(AsyncClient, frozenset({"4.10/10", "4.10/12"}), dialect)


class FetchesPartByPart(ClientCore):
    """Drops parts of a list that were not requested."""

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        items = list(found)
        parts = [each for each in items if isinstance(each, Frame) and each.opcode == 0x0B]
        return super()._process_items([each for each in items if each not in parts[1:]], now_s)


def test_parts_that_were_not_requested(certified: Certified) -> None:
    """A client that requests each part skips the case of joined parts (A-4.10-3 b)."""
    dialect = DEFAULT.replace(list_cont="request")
    cases = certified(FetchesPartByPart, frozenset({"2/6"}), dialect)
    rest = {case.id: case.verdict for case in cases if case.verdict not in GOOD}
    assert rest == {"2/6.list": Verdict.NONE}


def test_polls(wrong: Defect) -> None:
    """Polls are answered and are not taken for other requests."""
    assert not wrong(AutoResponder, frozenset({"2/10", "3/25", "3/33", "4/16", "4.8/1", "4.33/4"}))


class HoldsBackTransfers(AsyncClient):
    """Starts no transfer while a command executes."""

    async def upload(self, *args: Any, **named: Any) -> Any:
        await self._ended()
        return await super().upload(*args, **named)

    async def download(self, *args: Any, **named: Any) -> Any:
        await self._ended()
        return await super().download(*args, **named)

    async def _ended(self) -> None:
        await self.wait_for(lambda: not self._core._executing())


class DeclinesTransfers(HoldsBackTransfers):
    """Refuses transfers while a command executes."""

    async def _ended(self) -> None:
        if self._core._executing():
            raise ClientError("something executes")


@pytest.mark.parametrize("make", [HoldsBackTransfers, DeclinesTransfers])
def test_transfers_may_wait_for_an_executing_command(
    wrong: Defect, make: type[AsyncClient]
) -> None:
    """A client may or may not transfer files while a program runs."""
    assert not wrong(make, frozenset({"2/6", "3/27", "5.2/19", "5.3/11"}))


class AsksFirst(AsyncClient):
    """Reads the status before the version and the time."""

    async def get_version(self) -> str:
        await self.get_status()
        return await super().get_version()

    async def get_time(self) -> datetime:
        await self.get_status()
        return await super().get_time()


def test_asking_first(wrong: Defect) -> None:
    """Every case answers a poll that comes before the expected request."""
    assert not wrong(AsksFirst, frozenset({"2/5", "2/6", "3/27", "3/33"}))


class HangsUpAtStrays(AsyncClient):
    """Ends the connection at an unexpected frame (A-3-9)."""

    def _data_received(self, data: bytes) -> None:
        odd = map(GivesUp.is_odd, self._core.feed(data, asyncio.get_running_loop().time()))
        self._update()
        if any(odd) and self._transport is not None:
            self._transport.close()


def test_hanging_up_at_strays(wrong: Defect) -> None:
    """A client that ends the connection after such a frame has aborted its operation."""
    assert not wrong(HangsUpAtStrays, frozenset({"3/22", "3/33", "5.2/19"}))


class HangsUpAfterTimeouts(AsyncClient):
    """Ends the connection if a reply is missing."""

    async def perform(self, call: Any) -> Any:
        try:
            return await super().perform(call)
        except ReplyTimeout:
            await self.close()
            raise


class Patient(AsyncClient):
    """Waits for a reply as long as the connection lasts."""

    class core(ClientCore):  # noqa: N801 - it takes the place of an attribute
        @property
        def deadline_s(self) -> None:
            return None


@pytest.mark.parametrize("make", [HangsUpAfterTimeouts, Patient])
def test_missing_replies(certified: Certified, make: type[AsyncClient]) -> None:
    """A client may end the connection at a missing reply, or have no timeout."""
    cases = {case.id: case.verdict for case in certified(make, frozenset({"3/33"}))}
    for late in ("3/33.late", "3/33.late-again"):
        assert cases.pop(late) is Verdict.NONE
    assert set(cases.values()) <= set(GOOD)


def test_hanging_up_before_a_late_first_reply(wrong: Defect) -> None:
    """A client that waits three seconds for a first reply may then end the connection."""
    only = frozenset({"4/16.late-reply"})
    assert not wrong(HangsUpAfterTimeouts, only, DEFAULT.replace(reply_timeout="3"))


class LooksWhereItStopped(AsyncClient):
    """Reads the position before it reports the result of a stop."""

    async def emergency_stop(self) -> None:
        try:
            await super().emergency_stop()
        finally:
            await self.get_tool_coordinates()


def test_looking_where_the_arm_has_stopped(wrong: Defect) -> None:
    """No case holds back a query reply until the result of a stop is reported."""
    assert not wrong(LooksWhereItStopped, frozenset({"4.17/8", "4.17/10"}))


class Lists(Ceaseless):
    """Polls the program list."""

    pause_s = 1.0

    async def once(self) -> None:
        await self.list_programs()


@pytest.mark.parametrize("how", ["push", "request"])
def test_lists_that_are_polled(wrong: Defect, how: str) -> None:
    """A poll of a list with several parts gets the whole list (A-4.10-3)."""
    dialect = DEFAULT.replace(list_cont=how)
    assert not wrong(Lists, frozenset({"4.10/10"}), dialect)


class Looks(AsyncClient):
    """Checks the program list before and after operations on programs."""

    async def _look(self, name: Any, *, there: bool) -> None:
        if (name in await self.list_programs()) != there:
            raise ClientError("the list says otherwise")

    async def run_program(self, name: Any) -> None:
        await self._look(name, there=True)
        await super().run_program(name)

    async def delete_program(self, name: Any) -> None:
        await self._look(name, there=True)
        await super().delete_program(name)
        await self._look(name, there=False)

    async def upload(self, local: Any, remote: Any, *more: Any) -> None:
        await self._look(remote, there=False)
        await super().upload(local, remote, *more)
        await self._look(remote, there=True)

    async def download(self, remote: Any, *where: Any) -> Path:
        await self._look(remote, there=True)
        return await super().download(remote, *where)


def test_looking_at_the_list(wrong: Defect) -> None:
    """A client may compare an operation with the program list."""
    assert not wrong(Looks, frozenset({"4.11/1", "4.15/1", "5.2/1", "5.3/5"}))


class EndsWhenIdle(ClientCore):
    """Aborts executing commands when the status is idle; their result is unknown (4/11)."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        events = super().feed(data, now_s)
        for operation in self._executing() if b"\xcc\x09\x0200\xaa" in data else ():
            operation.fail(ProtocolError("the robot is idle, and no result came"))
            events += self._after_step(operation, now_s)
        return events


def test_short_timeouts(wrong: Defect) -> None:
    """A client may wait less than 5 s for a reply, and for a result while the robot runs."""
    assert not wrong(EndsWhenIdle, frozenset({"4/16"}), DEFAULT.replace(reply_timeout="1"))


class OneByOne(AsyncClient):
    """Runs one operation at a time, with a timeout of 1.5 s each."""

    _turn: asyncio.Lock | None = None

    async def perform(self, call: Any) -> Any:
        self._turn = self._turn or asyncio.Lock()
        async with self._turn:
            try:
                async with asyncio.timeout(1.5):
                    return await super().perform(call)
            except TimeoutError:
                raise ClientError("no answer") from None


def test_one_by_one(wrong: Defect) -> None:
    """A request sent after a timeout is not concurrent with the earlier one."""
    only = frozenset({"2/6", "4.14/4"})
    printed = wrong(OneByOne, only)
    del printed["2/6.among-others"]  # for which it would have to wait for a program
    assert set(printed.values()) == {"the client runs one operation at a time"}


class TwoAtATime(AsyncClient):
    """Runs two operations at a time, the latest first."""

    _running, _waiting = 0, 0

    async def perform(self, call: Any) -> Any:
        self._waiting += 1
        number = self._waiting
        await asyncio.sleep(0.1 / number)
        await self.wait_for(lambda: self._running < 2)
        self._running += 1
        try:
            return await super().perform(call)
        finally:
            self._running -= 1
            self._update()


def test_two_at_a_time(wrong: Defect) -> None:
    """Requests are answered in the order in which they arrive."""
    assert not wrong(TwoAtATime, frozenset({"3/1"}))


class WritesInPieces(AsyncClient):
    """Writes each request in pieces with delays (A-2-6)."""

    _free_s = 0.0

    def _update(self) -> None:
        data, loop = self._core.bytes_to_send(), asyncio.get_running_loop()
        if self._transport is not None and data:
            self._free_s = max(self._free_s, loop.time())
            for piece in (data[:1], data[1:3], data[3:]):
                loop.call_at(self._free_s, self._transport.write, piece)
                self._free_s += 0.06
        super()._update()


def test_requests_in_pieces(wrong: Defect) -> None:
    """The suite waits for the rest of a request after the operation has ended."""
    assert not wrong(WritesInPieces, frozenset({"5.1/2", "5.3/5"}))
    fetching = DEFAULT.replace(list_cont="request")
    assert not wrong(WritesInPieces, frozenset({"4.10/12"}), fetching)


def _network_of(value: Network) -> IPv4Network:
    return IPv4Network(f"{value.ip}/{value.mask}", strict=False)


class Careful(ClientCore):
    """Refuses values that its robot cannot execute or that look like mistakes."""

    _NAME = re.compile(rb"[A-Za-z0-9_-]{1,26}\.(rob|txt)")

    def command(self, name: str, value: Any = None) -> PendingOperation:
        match value:
            case MoveTarget() | Pose() if not 100 <= math.hypot(value.x, value.y) <= 400:
                raise ClientError("out of reach (A-4.24-5)")
            case Point() if max(map(abs, value)) > 1000:
                raise ClientError("too long a gripper")
            case PasswordChange() if len(value.new) < 4 or value.old == value.new:
                raise ClientError("too short a password, or no new one (A-4.1-3)")
            case Network() if IPv4Address(value.gateway) not in _network_of(value):
                raise ClientError("the gateway is in another network (A-4.4-2)")
            case bytes() if name != "login":
                self._check(value)
        return super().command(name, value)

    def upload(self, name: bytes, content: bytes) -> Upload:
        self._check(name)
        return super().upload(name, content)

    def _check(self, name: bytes) -> None:
        if not self._NAME.fullmatch(name):
            raise ClientError("a strange name (A-5-20)")


def test_values_that_a_client_refuses(certified: Certified) -> None:
    """A client may refuse values that the document does not require; this is reported."""
    only = frozenset({"4.2/1", "4.4/1", "4.11/1", "4.24/1", "5.2/1", "7/2"})
    cases = {case.id: case for case in certified(Careful, only)}
    rest = {case.id: case.verdict for case in cases.values() if case.verdict not in GOOD}
    assert rest == {"4.21/1.numbers": Verdict.NONE}  # each drawn pose is out of its reach
    refused = cases["4.11/1.names"]
    assert refused.verdict is Verdict.TOLERATED
    assert refused.message == "the client refuses delete_program without sending a request"
    assert "a strange name" in refused.observed


class SignalsLater(ClientCore):
    """Signals a failed upload when the next one begins (L787; A-5-10)."""

    _latest: Upload | None = None

    def upload(self, name: bytes, content: bytes) -> Upload:
        if self._latest is not None and self._latest.moved_bytes and self._latest.error:
            chunk = FILE_DATA.encode(Chunk(len(content), 0, 0, b""), self.dialect)
            self._send([Frame(A2C, BY_NAME["upload_chunk"].opcode, chunk)])
        self._latest = super().upload(name, content)
        return self._latest


def test_an_error_may_be_signalled_late(wrong: Defect) -> None:
    """The signal belongs to the previous upload."""
    assert not wrong(SignalsLater, frozenset({"5.2/8", "5.2/19"}))


class Strict(AsyncClient):
    """Follows the first of the listed readings and rejects tolerated forms."""

    class core(ClientCore):  # noqa: N801 - it takes the place of an attribute
        def command(self, name: str, value: Any = None) -> PendingOperation:
            if isinstance(value, MoveTarget | Pose):  # A-4.21-3
                value = value._replace(theta_y=0.0, theta_z=0.0)
            return super().command(name, value)

    async def get_initial_tool_position(self) -> Pose:
        return (await super().get_initial_tool_position())._replace(theta_y=0.0, theta_z=0.0)

    async def get_version(self) -> str:
        version = await super().get_version()
        return _checked(version, re.fullmatch(r"\d+\.\d+\.\d+", version))  # A-4.7-1

    async def get_status(self) -> Status:
        status = await super().get_status()
        code = lookup(status.code)
        odd = code is None or code.text != status.code or code in {*RESERVED, lookup("20")}
        return _checked(status, not odd)  # A-T-7, A-8-3, A-4.8-2

    async def get_running_program(self) -> RunningProgram | None:
        run = await super().get_running_program()
        return _checked(run, run is None or len(run.name) <= 30)  # A-4.9-5

    async def get_motor_temperatures(self) -> JointValues:
        values = await super().get_motor_temperatures()
        return JointValues(*(math.floor(value + 0.5) for value in values))  # A-4.14-2

    async def get_digital_inputs(self) -> str | None:  # none for an error
        try:
            return await super().get_digital_inputs()
        except Refused:
            return None


def _checked(value: T, right: object) -> T:
    if not right:
        raise ProtocolError("nothing that the document draws")
    return value


def test_first_readings(wrong: Defect) -> None:
    """A client may follow any reading that the register tolerates."""
    assert not wrong(Strict, frozenset({"3/1", "4.7/5", "4.8/11", "T/9"}))


class Distrusts(AsyncClient):
    """Reads back its settings, and moves only after an idle status."""

    _seen = "00"

    async def get_status(self) -> Status:
        status = await super().get_status()
        self._seen = status.code
        return status

    async def run_program(self, name: str | bytes) -> None:
        _checked(None, self._seen == "00")
        await super().run_program(name)

    async def set_gripper_center(self, x: float, y: float, z: float) -> None:
        await super().set_gripper_center(x, y, z)
        _checked(None, math.dist(await self.get_gripper_center(), (x, y, z)) < 0.01)

    async def set_default_program(self, name: str | bytes) -> None:
        await super().set_default_program(name)
        _checked(None, await self.get_default_program() == name)

    async def set_digital_output(self, port: int, value: int) -> None:
        await super().set_digital_output(port, value)
        _checked(None, (await self.get_digital_outputs())[-port] == f"{value}")


def test_distrust(wrong: Defect) -> None:
    """The simulated robot is consistent: queries return the values that were set."""
    assert not wrong(Distrusts, frozenset({"4.13/1", "4.20/1", "4.32/1", "8/6"}))


class WritesColumns(ClientCore):
    """Writes numbers with two decimals (A-T-5) and a bar after each field (A-T-4)."""

    _SEVERAL = (0x03, 0x05, 0x35, 0x39)
    _POINT = 0x35

    def _send(self, frames: Iterable[Frame]) -> None:
        super()._send(map(self._written, frames))

    def _written(self, frame: Frame) -> Frame:
        data = frame.data + b"|" * (frame.opcode in self._SEVERAL)
        if frame.opcode == self._POINT:
            data = b"".join(b"%.2f|" % float(text) for text in frame.data.split(b"|"))
        return frame._replace(data=data)


def test_columns(wrong: Defect) -> None:
    """Fixed decimals and a final bar are only reported as tolerated."""
    assert not wrong(WritesColumns, frozenset({"4.2/1", "4.24/1", "T/5", "T/6"}))
