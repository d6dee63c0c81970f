"""What happened is counted while it passes, and never costs more memory than was promised."""

from collections.abc import Callable

import pytest

from scaraspec.judge.judge import Judge
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import TransferState
from scaraspec.report.model import Results, Session
from scaraspec.report.session import SessionStats
from scaraspec.traffic.events import CaptureGap, LinkChange, Transfer
from scaraspec.traffic.wire import Kind, WireEvent

MS = 10**6


def session_of(*pieces: tuple[int, Direction, bytes]) -> Session:
    """The session in which these bytes passed on one connection, at these times."""
    judge, stats = Judge(), SessionStats()
    opened = WireEvent(0, "1", A2C, Kind.OPENED, note="client → controller")
    for event in (
        opened,
        *(WireEvent(time_ns, "1", sender, Kind.BYTES, data) for time_ns, sender, data in pieces),
        WireEvent(pieces[-1][0] + MS, "1", A2C, Kind.CLOSED),
    ):
        for item in judge.feed(event):
            stats.add(item)
    for item in judge.close():
        stats.add(item)
    session = stats.session()
    assert session
    return session


def request(opcode: int, data: bytes = b"") -> bytes:
    return Frame(A2C, opcode, data).encode()


def reply(opcode: int, data: bytes, *, tagged: bool = False) -> bytes:
    return Frame(C2A, opcode, data, tagged).encode()


def test_bytes_frames_and_the_time_are_counted() -> None:
    """Every byte of either direction, those that are no frame among them."""
    session = session_of(
        (1 * MS, A2C, request(0x01, b"password")),
        (2 * MS, C2A, reply(0x01, b"1")),
        (3 * MS, A2C, b"\x00\x00" + request(0x09)),
        (5 * MS, C2A, reply(0x09, b"00")),
    )
    assert session.bytes == {A2C: 12 + 2 + 4, C2A: 5 + 6}
    assert session.frames == 4
    assert session.undecodable_bytes == 2
    assert (session.begun_ns, session.ended_ns) == (0, 6 * MS)
    (connection,) = session.connections
    assert connection.bytes == session.bytes
    assert (connection.name, connection.frames, connection.ending) == ("1", 4, "closed")
    assert connection.note == "client → controller"


def test_commands_are_counted_with_their_latency() -> None:
    """Count, refusals, and the time to the first reply."""
    session = session_of(
        (1 * MS, A2C, request(0x09)),
        (2 * MS, C2A, reply(0x09, b"00")),
        (10 * MS, A2C, request(0x09)),
        (14 * MS, C2A, reply(0x09, b"00")),
        (20 * MS, A2C, request(0x0C, b"a.rob")),
        (21 * MS, C2A, reply(0x0C, b"0")),
    )
    status, delete = session.exchanges[1], session.exchanges[0]
    assert (status.name, status.count, status.refused) == ("get_status", 2, 0)
    assert status.latency
    assert (status.latency.min_ms, status.latency.max_ms) == (1, 4)
    assert status.duration is None
    assert (delete.name, delete.count, delete.refused) == ("delete_program", 1, 1)


def test_a_request_without_reply_is_counted_by_its_ending() -> None:
    """It has no latency, and is not forgotten."""
    (status,) = session_of((1 * MS, A2C, request(0x09))).exchanges
    assert status.latency is None
    assert dict(status.endings) == {"cut off": 1}


@pytest.mark.parametrize(
    ("pieces", "outcome", "code", "duration_ms"),
    [
        ([reply(0x30, b"1"), reply(0x30, b"11", tagged=True)], "done", "", 1),
        ([reply(0x30, b"1"), reply(0x30, b"00|11", tagged=True)], "failed", "11", 1),
        ([reply(0x30, b"0|20")], "refused", "20", None),
        ([reply(0x30, b"1")], "cut off", "", None),
    ],
)
def test_a_run_is_told_with_its_outcome(
    pieces: list[bytes], outcome: str, code: str, duration_ms: float | None
) -> None:
    """From the first reply to the final result, and the code that came with it."""
    answers = [(at * MS, C2A, piece) for at, piece in enumerate(pieces, 2)]
    (run,) = session_of((1 * MS, A2C, request(0x30, b"a.rob")), *answers).runs
    assert (run.name, run.simulated, run.outcome, run.code) == ("a.rob", False, outcome, code)
    assert run.duration_ms == duration_ms


def test_an_emergency_stop_interrupts_a_run() -> None:
    """The stopped run is shown as interrupted, whatever its own result is."""
    (run,) = session_of(
        (1 * MS, A2C, request(0x31, b"a.rob")),
        (2 * MS, C2A, reply(0x31, b"1")),
        (3 * MS, A2C, request(0x32)),
        (4 * MS, C2A, reply(0x32, b"1")),
        (5 * MS, C2A, reply(0x31, b"00|00", tagged=True)),
        (6 * MS, C2A, reply(0x32, b"11", tagged=True)),
    ).runs
    assert (run.simulated, run.outcome, run.code) == (True, "interrupted", "00")


def test_the_transfers_of_a_capture_are_listed(audited: Callable[[str], Results]) -> None:
    """Name, size and state of each, as the wire showed them."""
    session = audited("complaint-3").session
    assert session
    assert [
        (t.name, t.upload, t.size_bytes, t.received_bytes, t.state) for t in session.transfers
    ] == [("big.bin", True, 76800, 76800, "done"), ("big.bin", False, 76800, 76800, "done")]


def test_the_losses_of_a_capture_are_listed(audited: Callable[[str], Results]) -> None:
    """A torn capture says where it is torn."""
    session = audited("plant-a-torn").session
    assert session
    assert len(session.losses) == 4
    assert all(loss.connection and loss.note for loss in session.losses)


def test_lists_are_bounded_and_what_is_beyond_is_counted() -> None:
    """A capture of a year costs no more memory than that of a day."""
    stats = SessionStats()
    for number in range(700):
        stats.add(LinkChange(WireEvent(number, str(number), A2C, Kind.OPENED)))
        stats.add(LinkChange(WireEvent(number, str(number), A2C, Kind.CLOSED)))
        stats.add(CaptureGap(WireEvent(number, "0", C2A, Kind.GAP, length_bytes=3)))
        stats.add(Transfer(upload=True, name=b"a", begun_ns=number, state=TransferState.DONE))
    session = stats.session()
    assert session
    assert [len(x) for x in (session.connections, session.losses, session.transfers)] == [500] * 3
    assert session.unlisted == {"connections": 200, "losses": 200, "transfers": 200}


def test_where_nothing_happened_there_is_no_session() -> None:
    """No zero is made up."""
    assert SessionStats().session() is None
