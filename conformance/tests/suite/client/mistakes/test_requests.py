"""Mistakes of clients in requests: another value than the operation has, or none."""

import re
from collections.abc import Callable, Iterable, Mapping
from datetime import datetime
from typing import Any

import pytest

from scaraspec.client import AsyncClient, ClientCore, LoginFailed
from scaraspec.client.core import DOWNLOAD_LIMIT_BYTES
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.client.transfer import Download, Upload
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import BY_NAME, PasswordChange, PortValue
from scaraspec.protocol.fields import NAME_MAX_BYTES
from scaraspec.protocol.frames import MAX_DATA_BYTES, Frame

Try = Callable[..., Mapping[str, Verdict]]


class Tidies(ClientCore):
    """Strips passwords, writes years with two digits, and ports as bytes."""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        if isinstance(value, PasswordChange):
            value = PasswordChange(value.old.strip(), value.new.strip())
        elif isinstance(value, datetime):
            value = value.replace(year=2000 + value.year % 100)
        elif isinstance(value, PortValue):
            value = value._replace(port=value.port % 256)
        return super().command(name, value)


def test_values_are_sent_unchanged(tried: Try) -> None:
    """A client must not change passwords, years or port numbers."""
    cases = tried(Tidies, "4.2/1", "4.5/1", "4.32/1")
    for case in ("4.2/1.pairs", "4.5/1.times", "4.32/1.each"):
        assert cases[case] is Verdict.FAIL


class SetsWhatChanges(ClientCore):
    """Does not set an output again to the same value."""

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


def test_a_repeated_setting_is_sent_again(tried: Try) -> None:
    """A program may have changed the output since."""
    assert tried(SetsWhatChanges, "4.32/1.each")["4.32/1.each"] is Verdict.FAIL


class CountsCharacters(ClientCore):
    """Limits characters instead of bytes, and truncates."""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        if isinstance(value, PasswordChange) and len(b"|".join(value).decode()) <= MAX_DATA_BYTES:
            value = value._replace(new=value.new[: MAX_DATA_BYTES - len(value.old) - 1])
        elif isinstance(value, bytes) and len(value.decode()) <= MAX_DATA_BYTES:
            value = value[:NAME_MAX_BYTES]
        return super().command(name, value)


@pytest.mark.parametrize("requirement", ["3/28", "4.2/7"])
def test_the_limit_counts_bytes(tried: Try, requirement: str) -> None:
    """The limit is 255 bytes, not 255 characters."""
    assert Verdict.FAIL in tried(CountsCharacters, requirement).values()


class Formats(ClientCore):
    """Uses each text as a format string."""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        if isinstance(value, bytes):
            value = value.replace(b"%%", b"%")
        elif isinstance(value, PasswordChange):
            value = PasswordChange(*(text.replace(b"%%", b"%") for text in value))
        return super().command(name, value)


class SkipsEmptyLines(ClientCore):
    """Removes empty lines from files."""

    class _Kept(Download):
        def settle(self, value: Any) -> None:
            super().settle(value.replace(b"\n\n", b"\n"))

    def upload(self, name: bytes, content: bytes) -> Upload:
        return super().upload(name, content.replace(b"\n\n", b"\n"))

    def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
        return self._Kept(name, limit_bytes, self.dialect)


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
def test_content_is_not_altered(
    tried: Try, make: type[ClientCore] | type[AsyncClient], requirement: str, name: str
) -> None:
    """Percent signs and empty lines stay unchanged."""
    assert tried(make, requirement + name)[requirement + name] is Verdict.FAIL


def tidies(altered: Callable[[str], str]) -> type[AsyncClient]:
    """Return a client that alters names."""

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
        lambda name: name.replace("$&", "NAME"),
        lambda name: name.replace("${1}", ""),
        lambda name: name.replace("[1]", "1"),
        lambda name: f"{{{name}}}" if "{" in name else name,
        lambda name: f"{int(name)}" if name.isdigit() else name,
        lambda name: f"{float(name)}" if name == "1.50" else name,
        lambda name: f"{float(name)}" if name == "1e3" else name,
        lambda name: f"{int(name, 16)}" if name[:2] == "0x" else name,
    ],
)
def test_names_are_not_altered(tried: Try, altered: Callable[[str], str]) -> None:
    """The name to delete is sent unchanged, however unusual it is."""
    assert tried(tidies(altered), "T/10.outer-blanks")["T/10.outer-blanks"] is Verdict.FAIL


class SendsTimesAsGiven(ClientCore):
    """Sends a time unchanged."""

    given = ""

    def _send(self, frames: Iterable[Frame]) -> None:
        super()._send(
            Frame(frame.direction, frame.opcode, self.given.encode())
            if self.given and frame.opcode == BY_NAME["set_time"].opcode
            else frame
            for frame in frames
        )


def trusts(what: Callable[[str], bool]) -> type[AsyncClient]:
    """Return a client that parses the parts of some times without further checks."""

    class Trusts(AsyncClient):
        core = SendsTimesAsGiven

        async def set_time(self, time: Any) -> None:
            parts = time[:4], *(time[i : i + 2] for i in range(4, 14, 2))
            trusted = what(time)
            assert isinstance(self._core, SendsTimesAsGiven)
            self._core.given = time if trusted else ""
            if not trusted:
                await super().set_time(time)
                return
            year, month, day, hour, minute, second = (int(part) for part in parts)
            await super().set_time(datetime(year, month, day, hour, minute, second))  # noqa: DTZ001 - the robot's clock knows no zone

    return Trusts


@pytest.mark.parametrize(
    "what",
    [
        lambda time: len(time) < 14,
        lambda time: len(time) > 14 and time.isdigit(),
        lambda time: re.match(r"\d{14}$", time) is not None and len(time) > 14,
        lambda time: "+" in time,
        lambda time: not time.isascii(),
    ],
)
def test_a_time_has_14_digits(tried: Try, what: Callable[[str], bool]) -> None:
    """A time with parsable parts is not necessarily 14 digits."""
    assert tried(trusts(what), "4.5/2")["4.5/2"] is Verdict.FAIL


class TriesTheDefaultPassword(AsyncClient):
    """Retries a refused login with the password of the document."""

    async def login(self, password: Any) -> None:
        try:
            await super().login(password)
        except LoginFailed:
            await super().login("password")


def test_no_other_password_is_sent(tried: Try) -> None:
    """The client logs in only with the password of the operation."""
    assert tried(TriesTheDefaultPassword, "4.1/5.told-to")["4.1/5.told-to"] is Verdict.FAIL
