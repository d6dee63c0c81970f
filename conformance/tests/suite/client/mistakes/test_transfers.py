"""Mistakes of clients in transfers: where a transfer begins, and where it ends."""

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import pytest

from scaraspec.client import ClientCore
from scaraspec.client.core import DOWNLOAD_LIMIT_BYTES
from scaraspec.client.transfer import Download, Upload
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import Parsed
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import Receiver, TransferState

Try = Callable[..., Mapping[str, Verdict]]


class Resumes(ClientCore):
    """Resumes a failed transfer at its old position."""

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
def test_a_failed_transfer_starts_from_the_beginning(tried: Try, name: str) -> None:
    """A transfer after a failure starts from the beginning."""
    assert tried(Resumes, f"5.4/6.{name}")[f"5.4/6.{name}"] is Verdict.FAIL


class _EndsEarly(Receiver):
    """Compares the received bytes with the low 16 bits of the size."""

    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        taken = super().receive_chunk(data, now_s)
        if self.size_bytes and self.received_bytes == self.size_bytes % 2**16:
            self.state = TransferState.DONE
        return taken


class _EndsAtTheEnd(Receiver):
    """Checks the position before the length."""

    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        head = data[:12]
        if len(head) == 12 and head[:8] == head[:4] * 2 and not any(head[8:]):
            self.state = TransferState.DONE
            return True
        return super().receive_chunk(data, now_s)


class TakesSignalsForEnds(ClientCore):
    """Ends a download when a position equals the end, even if bytes are missing."""

    class _Short(Download):
        receiver = _EndsAtTheEnd

    def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
        return self._Short(name, limit_bytes, self.dialect)


@pytest.mark.parametrize("signal", ["length-0", "numbers-only"])
def test_an_error_signal_is_not_the_end(tried: Try, signal: str) -> None:
    """An error signal at the end position does not complete a download."""
    assert tried(TakesSignalsForEnds, f"5.3/8.{signal}")[f"5.3/8.{signal}"] is Verdict.FAIL


class CountsIn16Bits(ClientCore):
    """Ends a download when the size seems to be reached."""

    class _Short(Download):
        receiver = _EndsEarly

    def download(self, name: bytes, limit_bytes: int = 2**20) -> Download:
        return self._Short(name, limit_bytes, self.dialect)


def test_a_large_download_is_complete(tried: Try) -> None:
    """A 16-bit counter must not end a large download."""
    assert tried(CountsIn16Bits, "5.3/11.large")["5.3/11.large"] is Verdict.FAIL


class _LimitsAll(Upload):
    """Applies the timeout of one answer (L763) to all chunks together."""

    begun_s: float | None = None

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        begun_s = self.begun_s = now_s if self.begun_s is None else self.begun_s
        if now_s - begun_s > (self._dialect.seconds("xfer_timeout") or 0):
            self._fail_transfer("it took too long")
            return []
        return super().take(parsed, data, now_s)


class LimitsWholeUploads(ClientCore):
    def upload(self, name: bytes, content: bytes) -> Upload:
        return _LimitsAll(name, content, self.dialect)


def test_the_timeout_applies_to_each_reply(tried: Try) -> None:
    """The timeout applies to each answer, not to the whole upload."""
    assert tried(LimitsWholeUploads, "5.2/9")["5.2/9"] is Verdict.FAIL
