"""Faulty clients that are close to what the document leaves open, or that show nothing."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import pytest

from scaraspec.client import ClientCore, ClientError
from scaraspec.client.core import Event
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.client.transfer import Upload
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import BY_NAME, MoveTarget, Network, Parsed, Point, Pose
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.fields import NAME_MAX_BYTES
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.client.harness.operations import VALUES

_IDLE = Frame(C2A, BY_NAME["get_status"].opcode, b"00").encode()
_LISTED = ("delete_program", "set_default_program", "run_program", "simulate_program")

Try = Callable[..., Mapping[str, Verdict]]


def declines(what: Callable[[str, Any], object]) -> type[ClientCore]:
    """Return a client that refuses some operations without a request."""

    class Declines(ClientCore):
        def command(self, name: str, value: Any = None) -> PendingOperation:
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
    """Holds back the last byte until another one arrives."""

    held = b""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        data = self.held + data
        self.held = data[-1:]
        return super().feed(data[:-1], now_s)


def test_a_silent_client_fails(tried: Try) -> None:
    """No case can run, and the failure of the start is reported."""
    verdicts = dict(tried(WaitsForOneMore, "4.8/11"))
    assert verdicts.pop("run.begin") is Verdict.FAIL
    assert verdicts
    assert set(verdicts.values()) == {Verdict.INCONCLUSIVE}


def test_a_client_that_misreads_idle(tried: Try) -> None:
    """A client that misreads an idle status fails only for that."""
    verdicts = tried(MisreadsIdle, "4.8/11", "2/5", "5.4/6", "4/9")
    failed = {case for case, verdict in verdicts.items() if verdict is Verdict.FAIL}
    assert failed == {"run.begin", "4.8/11"}
    assert list(verdicts.values()).count(Verdict.PASS) > len(failed)
    assert Verdict.INCONCLUSIVE not in verdicts.values()


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
def test_ordinary_values_must_not_be_declined(
    tried: Try, core: type[ClientCore], requirement: str
) -> None:
    """No open point allows a client to refuse ordinary values."""
    assert Verdict.FAIL in tried(core, requirement).values()


def test_a_client_that_declines_everything(tried: Try) -> None:
    """A case in which nothing was sent is not a pass."""
    others = declines(lambda name, value: value != VALUES.get(name))
    cases = tried(others, "4.2/1", "4.5/1", "4.15/1", "4.20/1", "4.24/1", "T/5")
    for case in (
        *("4.2/1.pairs", "4.5/1.times", "4.15/1.names", "4.20/1.numbers", "4.24/1.numbers"),
        *("T/5", "T/5.poses"),
    ):
        assert cases[case] is Verdict.NONE


class WritesTinyNumbersWithExponents(ClientCore):
    """Writes numbers below a millionth with an exponent, as JavaScript does."""

    _numbers: Point = Point(0, 0, 0)

    def command(self, name: str, value: Any = None) -> PendingOperation:
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


def test_tiny_numbers_are_ordered(tried: Try) -> None:
    """A rounding error is sent without an exponent, or as 0."""
    assert tried(WritesTinyNumbersWithExponents, "4.20/1.numbers")["4.20/1.numbers"] is Verdict.FAIL


class GivesLongNamesUp(ClientCore):
    """Aborts an upload with a name of 30 bytes after the name was accepted."""

    class _GivenUp(Upload):
        def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
            super().take(parsed, data, now_s)
            self._fail_transfer("it is too long")
            return []

    def upload(self, name: bytes, content: bytes) -> Upload:
        if len(name) == NAME_MAX_BYTES:
            return self._GivenUp(name, content, DEFAULT)
        return super().upload(name, content)


def test_an_abort_is_not_a_local_refusal(tried: Try) -> None:
    """An abort after the name was sent is not a local refusal."""
    assert tried(GivesLongNamesUp, "5.2/1.drawn")["5.2/1.drawn"] is Verdict.FAIL


class SendsNoLongNames(ClientCore):
    """Does not send a name of 30 bytes, and waits for its reply."""

    def _send(self, frames: Iterable[Frame]) -> None:
        super()._send(each for each in frames if len(each.data) != NAME_MAX_BYTES)


def test_a_timeout_is_not_a_local_refusal(tried: Try) -> None:
    """A timeout of a request that was never sent is not a local refusal."""
    assert tried(SendsNoLongNames, "4.11/1.names")["4.11/1.names"] is Verdict.FAIL
