"""Clients that are near to what the document leaves open, and wrong; or that show nothing."""

import asyncio
import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import closing, suppress
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest

from scaraspec.cli.prove.client import MemoryClient
from scaraspec.client import AsyncClient, ClientCore, ClientError, LinkLost, LoginFailed
from scaraspec.client.core import DOWNLOAD_LIMIT_BYTES, Event
from scaraspec.client.exchange import Exchange, Listing, Stage, TwoStage
from scaraspec.client.transfer import Download, Upload
from scaraspec.judgement.verdicts import Verdict
from scaraspec.protocol.commands import (
    BY_NAME,
    MoveTarget,
    Network,
    Parsed,
    PasswordChange,
    Point,
    PortValue,
    Pose,
)
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.fields import NAME_MAX_BYTES
from scaraspec.protocol.frames import MAX_DATA_BYTES, Frame, Framer
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.protocol.transfer import BUFFER_BYTES, Receiver, State
from scaraspec.suite.as_controller.orders import VALUES
from scaraspec.suite.as_controller.setting import ClientSetting
from scaraspec.suite.plan import ALL, Options
from scaraspec.suite.run import Run
from scaraspec.suite.statement import Statement

_IDLE = Frame(C2A, BY_NAME["get_status"].opcode, b"00").encode()
_REFUSED_THEN_SENT = "5.2/19.download-refused-then-sent"
_LISTED = ("delete_program", "set_default_program", "run_program", "simulate_program")


def tried(make: type[ClientCore] | type[AsyncClient], *only: str) -> Mapping[str, Verdict]:
    """What comes of the cases of these requirements."""
    shell = make if issubclass(make, AsyncClient) else type("Made", (AsyncClient,), {"core": make})
    with closing(MemoryClient(shell, DEFAULT)) as access:
        options = Options(only=frozenset(only), allowed=ALL, examples=3, exhaustive=True)
        results = Run(ClientSetting(access, Statement(), options)).results()
    return {case.id: case.verdict for case in results.cases}


def declines(what: Callable[[str, Any], bool]) -> type[ClientCore]:
    """A client that declines some of what is ordered, sending nothing."""

    class Declines(ClientCore):
        def command(self, name: str, value: Any = None) -> Exchange:
            if value is not None and name != "login" and what(name, value):
                raise ClientError("no")
            return super().command(name, value)

    return Declines


def _has_numbers(value: Any) -> bool:
    return isinstance(value, Point | Pose | MoveTarget)


class MisreadsIdle(ClientCore):
    """Takes an idle robot for a resetting one."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        return super().feed(data.replace(_IDLE, _IDLE.replace(b"00", b"03")), now_s)


class WaitsForOneMore(ClientCore):
    """Takes no notice of the last byte that came until another one comes."""

    held = b""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        data = self.held + data
        self.held = data[-1:]
        return super().feed(data[:-1], now_s)


@pytest.mark.parametrize("core", [MisreadsIdle, WaitsForOneMore])
def test_who_is_wrong_from_the_start_fails(core: type[ClientCore]) -> None:
    """No case can be tried, and what was wrong is a failure all the same."""
    verdicts = tried(core, "4.8/11")
    assert verdicts.pop("run.begin") is Verdict.FAIL
    assert set(verdicts.values()) == {Verdict.INCONCLUSIVE}


@pytest.mark.parametrize(
    ("core", "requirement"),
    [
        (declines(lambda _, value: _has_numbers(value) and min(value) < 0), "T/10"),
        (declines(lambda _, value: _has_numbers(value) and 0 in value[:2]), "T/10"),
        (declines(lambda _, value: isinstance(value, Point) and value.x % 1), "T/10"),
        (declines(lambda _, value: isinstance(value, bytes) and value != value.lower()), "T/10"),
        (declines(lambda name, value: name in _LISTED and len(value) > 12), "T/10"),
        (
            declines(lambda name, value: isinstance(value, Network) and value != VALUES[name]),
            "4.4/1",
        ),
    ],
)
def test_what_is_ordinary_is_not_declined(core: type[ClientCore], requirement: str) -> None:
    """No silence of the register covers a sign, a zero, a decimal, a capital, or a private net."""
    assert Verdict.FAIL in tried(core, requirement).values()


def test_who_declines_everything_has_shown_nothing() -> None:
    """A case of which nothing was sent is no pass."""
    others = declines(lambda name, value: value != VALUES.get(name))
    cases = tried(others, "4.2/1", "4.5/1", "4.15/1", "4.20/1", "4.24/1", "T/5")
    for case in (
        *("4.2/1.pairs", "4.5/1.times", "4.15/1.names", "4.20/1.numbers", "4.24/1.numbers"),
        *("T/5", "T/5.poses"),
    ):
        assert cases[case] is Verdict.NONE


class WritesTinyNumbersWithExponents(ClientCore):
    """Numbers are written as JavaScript prints them: with an exponent below a millionth."""

    _numbers: Point = Point(0, 0, 0)

    def command(self, name: str, value: Any = None) -> Exchange:
        self._numbers = value if isinstance(value, Point) else self._numbers
        return super().command(name, value)

    def _send(self, frames: Iterable[Frame]) -> None:
        super()._send(map(self._written, frames))

    def _written(self, frame: Frame) -> Frame:
        if frame.opcode != BY_NAME["set_gripper_center"].opcode:
            return frame
        texts = zip(frame.data.split(b"|"), self._numbers, strict=True)
        tiny = (b"%.1e" % n if 0 < abs(n) < 1e-6 else text for text, n in texts)
        return frame._replace(data=b"|".join(tiny))


def test_tiny_numbers_are_ordered() -> None:
    """What is left of a cosine of 90 degrees is sent without an exponent, or as 0."""
    assert tried(WritesTinyNumbersWithExponents, "4.20/1")["4.20/1.numbers"] is Verdict.FAIL


class GivesLongNamesUp(ClientCore):
    """A file whose name has thirty bytes is given up when its name has been taken."""

    class _GivenUp(Upload):
        def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
            super().take(parsed, data, now_s)
            self._give_up("it is too long")
            return []

    def upload(self, name: bytes, content: bytes) -> Upload:
        if len(name) == NAME_MAX_BYTES:
            return self._GivenUp(name, content, DEFAULT)
        return super().upload(name, content)


def test_what_is_begun_is_not_declined() -> None:
    """Who has sent a name that was taken, and then gives up, has not declined the order."""
    assert tried(GivesLongNamesUp, "5.2/1")["5.2/1.drawn"] is Verdict.FAIL


class SendsNoLongNames(ClientCore):
    """A name of thirty bytes is not sent, and its reply waited for in vain."""

    def _send(self, frames: Iterable[Frame]) -> None:
        super()._send(each for each in frames if len(each.data) != NAME_MAX_BYTES)


def test_what_is_tried_is_not_declined() -> None:
    """A client that gives up when it has waited for a reply has not declined to ask."""
    assert tried(SendsNoLongNames, "4.11/1")["4.11/1.names"] is Verdict.FAIL


class HoldsThreeHundredBytes(ClientCore):
    """What comes at once and is more than its buffer holds is lost."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        return super().feed(data[:300], now_s)


class LooksForFramesInData(ClientCore):
    """While a frame is not whole it goes on where a frame seems to end and another to begin."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        events = super().feed(data, now_s)
        held = data[len(data) - self._framer.held_bytes :]
        _, mark, behind = held.partition(b"\xaa\xcc")
        if mark:
            self._framer = Framer(C2A)
            events += super().feed(mark[1:] + behind, now_s)
        return events


class ListsEndAtOtherFrames(ClientCore):
    """Any other frame ends a list that is coming."""

    coming = False

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        of_list = frame.opcode == BY_NAME["list_programs"].opcode
        if of_list:
            self.coming = frame.data.startswith(b"1")
        elif self.coming:
            return self._dispatch(Frame(C2A, BY_NAME["list_programs"].opcode, b"0"), now_s)
        return super()._dispatch(frame, now_s)


class KeepsHalves(ClientCore):
    """What had come of a frame when its connection ended begins what comes on the next one."""

    kept = Framer(C2A)

    def __init__(self, dialect: Dialect) -> None:
        super().__init__(dialect)
        self._framer, self._heard_s = self.kept, math.inf  # nothing was heard yet

    def lose(self, reason: str, now_s: float) -> list[Event]:
        self._framer = Framer(C2A)
        return super().lose(reason, now_s)


def test_half_a_frame_ends_with_its_connection() -> None:
    """A reply to the next login is not taken for the rest of it."""
    assert tried(KeepsHalves, "3/29")["3/29"] is Verdict.FAIL


@pytest.mark.parametrize(
    ("core", "case"),
    [
        (HoldsThreeHundredBytes, "2/6.list"),
        (LooksForFramesInData, "3/9"),
        (ListsEndAtOtherFrames, "4.10/10.late"),
    ],
)
def test_what_a_stream_may_bring_is_brought(core: type[ClientCore], case: str) -> None:
    """Full frames come at once, half a frame's data looks like frames, results come anywhere."""
    only, _, _ = case.partition(".l")
    assert tried(core, only)[case] is Verdict.FAIL


class WaitsOnForLostAnswers(ClientCore):
    """The answer that a transfer was given up for is still waited for, and takes the next one."""

    owed = False

    class _Owed(Upload):
        core: "WaitsOnForLostAnswers"

        def _give_up(self, reason: str) -> None:
            self.core.owed = True
            super()._give_up(reason)

    def upload(self, name: bytes, content: bytes) -> Upload:
        upload = self._Owed(name, content, DEFAULT)
        upload.core = self
        return upload

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if self.owed and frame.opcode == BY_NAME["upload_chunk"].opcode:
            self.owed = False
            return []
        return super()._dispatch(frame, now_s)


def test_an_answer_that_never_came_is_owed_no_more() -> None:
    """The first answer behind a silence is that of the next transfer."""
    assert tried(WaitsOnForLostAnswers, "5.2/9")["5.2/9.meanwhile"] is Verdict.FAIL


class NeedsNoLastAnswer(ClientCore):
    """An upload is done when its last chunk was sent, answered in time or not."""

    class _Sent(Upload):
        def expire(self, now_s: float) -> list[Frame]:
            if self.accepted and self.moved_bytes + BUFFER_BYTES >= len(self._content):
                self.settle(None)
                return []
            return super().expire(now_s)

    def upload(self, name: bytes, content: bytes) -> Upload:
        return self._Sent(name, content, DEFAULT)


class DoneWhenIdle(ClientCore):
    """What executes is done when the status is idle, whatever its result will be."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        events = super().feed(data, now_s)
        for exchange in self._executing() if _IDLE in data else ():
            exchange.settle(None)
            events += self._follow(exchange, now_s)
        return events


class AsksUntilIdle(AsyncClient):
    """Asks for the status while a program runs; it is done when the robot is idle."""

    async def run_program(self, name: Any) -> None:
        run = await self.start_run_program(name)
        while not run.done:
            await asyncio.sleep(0.5)
            if not run.done and (await self.get_status()).code == "00":
                return
        await run.wait()


class DoneWhenLost(ClientCore):
    """What executes is done when the link is lost."""

    def lose(self, reason: str, now_s: float) -> list[Event]:
        events = []
        for exchange in self._executing():
            exchange.settle(None)
            events += self._follow(exchange, now_s)
        return events + super().lose(reason, now_s)


@pytest.mark.parametrize(
    ("make", "case"),
    [
        (NeedsNoLastAnswer, "5.2/9.meanwhile"),
        (DoneWhenIdle, "4/16.while-idle"),
        (AsksUntilIdle, "4/16.while-idle"),
        (DoneWhenLost, "4/16.reconnected"),
    ],
)
def test_what_was_not_answered_is_not_done(
    make: type[ClientCore] | type[AsyncClient], case: str
) -> None:
    """Neither silence, nor an idle robot, nor the end of the link says how something ended."""
    assert tried(make, case.rpartition(".")[0])[case] is Verdict.FAIL


class Tidies(ClientCore):
    """Takes the blanks off the ends of passwords, writes years with two digits, ports as bytes."""

    def command(self, name: str, value: Any = None) -> Exchange:
        if isinstance(value, PasswordChange):
            value = PasswordChange(value.old.strip(), value.new.strip())
        elif isinstance(value, datetime):
            value = value.replace(year=2000 + value.year % 100)
        elif isinstance(value, PortValue):
            value = value._replace(port=value.port % 256)
        return super().command(name, value)


def test_what_is_ordered_is_sent_as_it_is() -> None:
    """Neither a password's blanks, a year's century nor another port are the client's to change."""
    cases = tried(Tidies, "4.2/1", "4.5/1", "4.32/1")
    for case in ("4.2/1.pairs", "4.5/1.times", "4.32/1.each"):
        assert cases[case] is Verdict.FAIL


class SetsWhatChanges(ClientCore):
    """An output that was set to a value is not set to it again."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._values: dict[bytes, bytes] = {}

    def _send(self, frames: Iterable[Frame]) -> None:
        super()._send([frame for frame in frames if self._changes(frame)])

    def _changes(self, frame: Frame) -> bool:
        if frame.opcode != BY_NAME["set_digital_output"].opcode:
            return True
        port, _, value = frame.data.partition(b"|")
        before, self._values[port] = self._values.get(port), value
        return value != before


def test_what_is_ordered_again_is_sent_again() -> None:
    """A program may have changed the output meanwhile."""
    assert tried(SetsWhatChanges, "4.32/1")["4.32/1.each"] is Verdict.FAIL


class CountsCharacters(ClientCore):
    """Takes what has few enough characters for short enough, and sends what fits of it."""

    def command(self, name: str, value: Any = None) -> Exchange:
        if isinstance(value, PasswordChange) and len(b"|".join(value).decode()) <= MAX_DATA_BYTES:
            value = value._replace(new=value.new[: MAX_DATA_BYTES - len(value.old) - 1])
        elif isinstance(value, bytes) and len(value.decode()) <= MAX_DATA_BYTES:
            value = value[:NAME_MAX_BYTES]
        return super().command(name, value)


@pytest.mark.parametrize("requirement", ["3/28", "4.2/7"])
def test_characters_are_no_bytes(requirement: str) -> None:
    """255 bytes are the limit, not 255 characters."""
    assert Verdict.FAIL in tried(CountsCharacters, requirement).values()


class TellsHalfAList(ClientCore):
    """What has come of a program list when the connection ends is told as the list."""

    class _Half(Listing):
        def fail(self, problem: ClientError) -> None:
            if self._names and isinstance(problem, LinkLost):
                self.settle(tuple(self._names))
            else:
                super().fail(problem)

    def command(self, name: str, value: Any = None) -> Exchange:
        if name != "list_programs":
            return super().command(name, value)
        return self._Half(BY_NAME[name], value, self.dialect)


def test_half_a_list_is_none() -> None:
    """A list whose last part has not come is not told as one."""
    assert tried(TellsHalfAList, "4.10/10")["4.10/10.many"] is Verdict.FAIL


class TakesLossForYes(ClientCore):
    """What was set when the connection ended is told as done."""

    class _Sent(Exchange):
        def fail(self, problem: ClientError) -> None:
            if isinstance(problem, LinkLost):
                self.settle(None)
            else:
                super().fail(problem)

    def command(self, name: str, value: Any = None) -> Exchange:
        if name != "set_time":
            return super().command(name, value)
        return self._Sent(BY_NAME[name], value, self.dialect)


class TakesLossForStopped(ClientCore):
    """A stop that was executing when the connection ended is told as done."""

    class _Sent(TwoStage):
        def fail(self, problem: ClientError) -> None:
            if isinstance(problem, LinkLost) and self.stage is Stage.EXECUTING:
                self.settle(None)
            else:
                super().fail(problem)

    def command(self, name: str, value: Any = None) -> Exchange:
        if name != "emergency_stop":
            return super().command(name, value)
        return self._Sent(BY_NAME[name], value, self.dialect)


class Formats(ClientCore):
    """A text is a format of its own."""

    def command(self, name: str, value: Any = None) -> Exchange:
        if isinstance(value, bytes):
            value = value.replace(b"%%", b"%")
        elif isinstance(value, PasswordChange):
            value = PasswordChange(*(text.replace(b"%%", b"%") for text in value))
        return super().command(name, value)


class SkipsEmptyLines(ClientCore):
    """Files are sent, and written, without the lines that hold nothing."""

    class _Kept(Download):
        def settle(self, value: Any) -> None:
            super().settle(value.replace(b"\n\n", b"\n"))

    def upload(self, name: bytes, content: bytes) -> Upload:
        return super().upload(name, content.replace(b"\n\n", b"\n"))

    def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
        return self._Kept(name, limit_bytes, self.dialect)


class CutsTexts(ClientCore):
    """Passwords, and the names of programs to run, have nine bytes at most."""

    def command(self, name: str, value: Any = None) -> Exchange:
        cut = value[:9] if name in ("login", "run_program") else value
        return super().command(name, cut)


def test_what_is_wrong_costs_no_time_out() -> None:
    """A request that carries something else is answered all the same, and the next one sent."""
    shell = type("Made", (AsyncClient,), {"core": CutsTexts})
    with closing(MemoryClient(shell, DEFAULT)) as access:
        options = Options(only=frozenset({"4.1/1", "4.15/1"}), allowed=ALL, examples=3)
        begun_s = access.now_s
        results = Run(ClientSetting(access, Statement(), options)).results()
        assert access.now_s - begun_s < 1
    verdicts = {case.id: case.verdict for case in results.cases}
    assert verdicts["4.1/1.passwords"] is verdicts["4.15/1.names"] is Verdict.FAIL


class WritesNowhere(AsyncClient):
    """A download that cannot be written is told as done."""

    async def download(self, remote: Any, *where: Any) -> Path:
        with suppress(OSError):
            return await super().download(remote, *where)
        return Path()


@pytest.mark.parametrize(
    ("make", "case"),
    [
        (TakesLossForYes, "3/33.flag"),
        (TakesLossForStopped, "4/16.reconnected"),
        (WritesNowhere, _REFUSED_THEN_SENT),
    ],
)
def test_nothing_is_no_success(make: type[ClientCore] | type[AsyncClient], case: str) -> None:
    """Neither a missing reply nor a missing file is told as done."""
    assert tried(make, case.rpartition(".")[0])[case] is Verdict.FAIL


class Resumes(ClientCore):
    """What of a file had been moved when its transfer broke off is kept for the next one."""

    class _Kept(Download):
        kept = b""

        def settle(self, value: Any) -> None:
            super().settle(self.kept + value)

    @cached_property
    def _begun(self) -> dict[bytes, Upload | Download]:
        return {}

    def _moved_bytes(self, name: bytes) -> int:
        return self._begun[name].moved_bytes if name in self._begun else 0

    def upload(self, name: bytes, content: bytes) -> Upload:
        upload = super().upload(name, content[self._moved_bytes(name) :])
        self._begun[name] = upload
        return upload

    def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
        download = self._Kept(name, limit_bytes, self.dialect)
        download.kept = bytes(self._moved_bytes(name))
        self._begun[name] = download
        return download


@pytest.mark.parametrize("name", ["upload", "download"])
def test_what_broke_off_begins_anew(name: str) -> None:
    """No part of the first try is taken for one of the second."""
    assert tried(Resumes, "5.4/6")[f"5.4/6.{name}"] is Verdict.FAIL


@pytest.mark.parametrize(
    ("make", "requirement", "name"),
    [
        (Formats, "4.1/1", ".passwords"),
        (Formats, "4.2/1", ".pairs"),
        (Formats, "4.11/1", ".names"),
        (SkipsEmptyLines, "5.2/20", ""),
        (SkipsEmptyLines, "5.3/11", ".content"),
    ],
)
def test_nothing_is_tidied_up(
    make: type[ClientCore] | type[AsyncClient], requirement: str, name: str
) -> None:
    """Two percent signs are two, and an empty line is a line."""
    assert tried(make, requirement)[requirement + name] is Verdict.FAIL


def tidies(altered: Callable[[str], str]) -> type[AsyncClient]:
    """A client with an opinion of what a name should be like."""

    class Tidies(AsyncClient):
        async def delete_program(self, name: Any) -> None:
            await super().delete_program(altered(name))

    return Tidies


@pytest.mark.parametrize(
    "altered",
    [
        lambda name: name.lstrip("."),
        lambda name: name.rstrip("."),
        lambda name: name.replace("..", "."),
        lambda name: name.replace("--", "-"),
        lambda name: name.replace("  ", " "),
        lambda name: name.replace("\t", ""),
        lambda name: name.replace("%20", " "),
    ],
)
def test_another_name_is_another_program(altered: Callable[[str], str]) -> None:
    """What is deleted has the name that was given, however odd it is."""
    assert tried(tidies(altered), "T/10")["T/10.outer-blanks"] is Verdict.FAIL


class SendsTimesAsGiven(ClientCore):
    """A time is put into its frame as it was given."""

    given = ""

    def _send(self, frames: Iterable[Frame]) -> None:
        super()._send(
            Frame(frame.direction, frame.opcode, self.given.encode())
            if self.given and frame.opcode == BY_NAME["set_time"].opcode
            else frame
            for frame in frames
        )


def trusts(what: Callable[[str], bool]) -> type[AsyncClient]:
    """A client that takes the parts of some times for numbers, and looks no further."""

    class Trusts(AsyncClient):
        core = SendsTimesAsGiven

        async def set_time(self, time: Any) -> None:
            parts = time[:4], *(time[i : i + 2] for i in range(4, 14, 2))
            trusted = what(time)
            self._core.given = time if trusted else ""
            await super().set_time(datetime(*map(int, parts)) if trusted else time)  # noqa: DTZ001 - the robot's clock knows no zone

    return Trusts


@pytest.mark.parametrize(
    "what",
    [
        lambda time: len(time) < 14,
        lambda time: len(time) > 14,
        lambda time: "+" in time,
        lambda time: not time.isascii(),
    ],
)
def test_a_time_is_digits(what: Callable[[str], bool]) -> None:
    """That its parts can be read makes no time of fourteen characters."""
    assert tried(trusts(what), "4.5/2")["4.5/2"] is Verdict.FAIL


class TriesTheDefaultPassword(AsyncClient):
    """A login that is refused is tried again with the password of the document."""

    async def login(self, password: Any) -> None:
        try:
            await super().login(password)
        except LoginFailed:
            await super().login("password")


def test_no_password_is_made_up() -> None:
    """Only what was given is logged in with."""
    assert tried(TriesTheDefaultPassword, "4.1/5")["4.1/5.told-to"] is Verdict.FAIL


def misreads(name: str, data: bytes, other: str, taken: bytes) -> type[ClientCore]:
    """A client that takes one frame for another."""
    sent = Frame(C2A, BY_NAME[name].opcode, data).encode()
    read = Frame(C2A, BY_NAME[other].opcode, taken).encode()

    class Misreads(ClientCore):
        def feed(self, data: bytes, now_s: float) -> list[Event]:
            return super().feed(data.replace(sent, read), now_s)

    return Misreads


@pytest.mark.parametrize(
    ("name", "data", "other", "taken", "case"),
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
        ("get_default_program", b"1.rob", "get_default_program", b".rob", "T/9.default-program"),
        (
            *("get_default_program", b"pick and place.rob", "get_default_program", b"pick"),
            "T/9.default-program",
        ),
    ],
)
def test_what_is_told_is_what_was_sent(
    name: str, data: bytes, other: str, taken: bytes, case: str
) -> None:
    """Another reply, code, time or name, cut decimals, 16 bits, and nothing are told apart."""
    assert tried(misreads(name, data, other, taken), case.rpartition(".")[0])[case] is Verdict.FAIL


class _EndsEarly(Receiver):
    """Holds the bytes received against the low half of the size."""

    def take(self, data: bytes, now_s: float) -> bool | None:
        taken = super().take(data, now_s)
        if self.size_bytes and self.received_bytes == self.size_bytes % 2**16:
            self.state = State.DONE
        return taken


class _EndsAtTheEnd(Receiver):
    """Looks for the end first, and for the length then."""

    def take(self, data: bytes, now_s: float) -> bool | None:
        head = data[:12]
        if len(head) == 12 and head[:8] == head[:4] * 2 and not any(head[8:]):
            self.state = State.DONE
            return True
        return super().take(data, now_s)


class TakesSignalsForEnds(ClientCore):
    """A download has ended where a position is that of the end, whatever is missing."""

    class _Short(Download):
        receiver = _EndsAtTheEnd

    def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
        return self._Short(name, limit_bytes, self.dialect)


@pytest.mark.parametrize("signal", ["length-0", "numbers-only"])
def test_an_error_signal_is_no_end(signal: str) -> None:
    """Position and length make up the size, and bytes are missing."""
    assert tried(TakesSignalsForEnds, "5.3/8")[f"5.3/8.{signal}"] is Verdict.FAIL


class CountsIn16Bits(ClientCore):
    """A download has ended where its size seems to be reached."""

    class _Short(Download):
        receiver = _EndsEarly

    def download(self, name: bytes, limit_bytes: int = 2**20) -> Download:
        return self._Short(name, limit_bytes, self.dialect)


def test_no_download_is_over_too_early() -> None:
    """A small sum does not end a large file."""
    assert tried(CountsIn16Bits, "5.3/11")["5.3/11.large"] is Verdict.FAIL
