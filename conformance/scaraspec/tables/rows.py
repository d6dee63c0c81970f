"""The rows of one capture, made from what a judge yields. No verdict is made here."""

from collections.abc import Iterator

from scaraspec.judge.verdicts import Finding, Verdict
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.fields import show
from scaraspec.report.model import Session
from scaraspec.tables.schema import (
    ExchangeRow,
    FileRow,
    FindingRow,
    FrameRow,
    LossRow,
    Row,
    SessionRow,
    TransferRow,
)
from scaraspec.traffic.events import CaptureGap, Exchange, FrameSeen, TrafficEvent, Transfer
from scaraspec_recorder.sinks import text as event_text

SIDES = {A2C: "client", C2A: "controller"}
"""The name of the side that sends in each direction."""

_NS = 1e9


class RowBuilder:
    """Makes the rows of one capture.

    Args:
        file: The name of the capture, as in the column `file`.
    """

    def __init__(self, file: str) -> None:
        self._file = file
        self._exchanges = 0

    def take(self, item: TrafficEvent | Finding) -> Row | None:
        """Return the row of an item that the judge yielded; None if no table has it."""
        match item:
            case FrameSeen():
                return self._frame(item)
            case Exchange():
                return self._exchange(item)
            case Transfer():
                return self._transfer(item)
            case Finding() if item.verdict is not Verdict.PASS:
                return self._finding(item)
            case CaptureGap() if item.event.is_loss:
                return self._loss(item)
            case _:
                return None

    def finish(
        self, session: Session | None, *, whole: bool, notes: tuple[str, ...], verdict: str | None
    ) -> Iterator[Row]:
        """Yield the rows that are known at the end: those of the connections, and of the file.

        Args:
            session: The statistics of all items; None without items.
            whole: Whether nothing is missing in the file.
            notes: What is missing or unusual.
            verdict: The verdict about the file; None if it was not judged.
        """
        for each in session.connections if session else ():
            yield SessionRow(
                file=self._file,
                connection=each.name,
                begun_ns=each.begun_ns,
                ended_ns=each.ended_ns,
                ending=each.ending,
                addresses=each.note,
                client_bytes=each.bytes[A2C],
                controller_bytes=each.bytes[C2A],
                frames=each.frames,
            )
        yield FileRow(
            file=self._file,
            begun_ns=session.begun_ns if session else None,
            ended_ns=session.ended_ns if session else None,
            whole=whole,
            notes="; ".join(notes),
            verdict=verdict,
        )

    def _frame(self, seen: FrameSeen) -> FrameRow:
        return FrameRow(
            file=self._file,
            connection=seen.place.connection,
            time_ns=seen.place.time_ns,
            direction=seen.place.direction.value,
            offset_bytes=seen.place.offset_bytes,
            length_bytes=seen.place.length_bytes,
            command=seen.name,
            part=event_text.part_of(seen),
            text=event_text.frame_text(seen),
        )

    def _exchange(self, exchange: Exchange) -> ExchangeRow:
        self._exchanges += 1
        place = exchange.request.place
        return ExchangeRow(
            file=self._file,
            number=self._exchanges,
            connection=place.connection,
            time_ns=place.time_ns,
            side=SIDES[place.direction],
            command=exchange.name,
            arguments=event_text.frame_text(exchange.request),
            reply=_reply(exchange),
            result=event_text.frame_text(exchange.result) if exchange.result else None,
            accepted=exchange.accepted,
            code=_code(exchange),
            ending=exchange.ending.value,
            latency_s=_seconds(exchange.latency_ns),
            duration_s=_seconds(exchange.duration_ns),
            offset_bytes=place.offset_bytes,
            certain=exchange.certain,
        )

    def _transfer(self, transfer: Transfer) -> TransferRow:
        opening = transfer.opening
        return TransferRow(
            file=self._file,
            connection=opening.request.place.connection if opening else None,
            time_ns=transfer.begun_ns,
            upload=transfer.upload,
            name=show(transfer.name),
            state=transfer.state.value,
            reason=transfer.reason,
            size_bytes=None if transfer.size_bytes < 0 else transfer.size_bytes,
            received_bytes=transfer.received_bytes,
            chunks=transfer.chunks,
            duration_s=(transfer.ended_ns - transfer.begun_ns) / _NS,
            certain=transfer.certain,
        )

    def _finding(self, finding: Finding) -> FindingRow:
        place = finding.evidence[-1] if finding.evidence else None
        return FindingRow(
            file=self._file,
            connection=place.connection if place else None,
            time_ns=place.time_ns if place else None,
            side=finding.side.value if finding.side else "both",
            requirement=finding.requirement,
            verdict=finding.verdict.value,
            cause=finding.cause.value,
            message=str(finding.message),
            reading="=".join(finding.reading) if finding.reading else None,
            direction=place.direction.value if place else None,
            offset_bytes=place.offset_bytes if place else None,
            length_bytes=place.length_bytes if place else None,
        )

    def _loss(self, gap: CaptureGap) -> LossRow:
        event = gap.event
        return LossRow(
            file=self._file,
            connection=event.connection,
            time_ns=event.time_ns,
            direction=Direction(event.direction).value,
            offset_bytes=event.offset_bytes,
            length_bytes=None if event.length_bytes < 0 else event.length_bytes,
            reason=event.note,
        )


def _reply(exchange: Exchange) -> str | None:
    """Return the text of the first reply, or of the invalid bytes in its place."""
    if exchange.reply:
        return event_text.frame_text(exchange.reply)
    return event_text.hex_text(exchange.malformed) if exchange.malformed else None


def _code(exchange: Exchange) -> str | None:
    outcome = exchange.outcome
    code = outcome.code if outcome else getattr(exchange.reply_value, "code", None)
    return code or None


def _seconds(duration_ns: int | None) -> float | None:
    return None if duration_ns is None else duration_ns / _NS
