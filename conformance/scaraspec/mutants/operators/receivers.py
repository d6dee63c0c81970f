"""Receivers of files that judge chunks wrongly: in uploads to controllers, downloads to clients."""

from collections.abc import Callable
from typing import Any

from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.protocol.transfer import FILE_DATA, Chunk, Receiver, TransferState

Judgement = Callable[[Receiver, Chunk], bool]


def judging(
    *,
    accepts: Judgement = lambda _receiver, _chunk: False,
    refuses: Judgement = lambda _receiver, _chunk: False,
    complete: Judgement = lambda receiver, _chunk: receiver.state is TransferState.DONE,
) -> type[Receiver]:
    """A receiver with other rules.

    Args:
        accepts: Chunks that are accepted although they are wrong.
        refuses: Chunks that are refused although they are right.
        complete: Whether the file is complete after an accepted chunk.
    """

    class Judging(Receiver):
        def _problem(self, chunk: Chunk) -> str:
            if accepts(self, chunk):
                return ""
            return "refused" if refuses(self, chunk) else super()._problem(chunk)

        def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
            taken = super().receive_chunk(data, now_s)
            if taken:
                chunk = FILE_DATA.decode(data).value
                self.state = TransferState.DONE if complete(self, chunk) else TransferState.ACTIVE
            return taken

    return Judging


def taking(change: Callable[[Chunk], Chunk]) -> type[Receiver]:
    """A receiver that changes chunks before it judges them."""

    class Taking(Receiver):
        def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
            chunk = FILE_DATA.decode(data).value
            if chunk is not None and (changed := change(chunk)) != chunk:
                data = FILE_DATA.encode(changed)
            return super().receive_chunk(data, now_s)

    return Taking


def timing_out(timeout_s: int) -> type[Receiver]:
    """A receiver with another timeout."""

    class TimingOut(Receiver):
        def __init__(self, now_s: float, dialect: Dialect = DEFAULT, **limits: Any) -> None:
            super().__init__(now_s, dialect.replace(xfer_timeout=str(timeout_s)), **limits)

    return TimingOut
