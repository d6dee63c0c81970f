"""Statistics of a session, in bounded memory."""

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
    """Return the session with these bytes and times on one connection."""
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


def test_bytes_frames_and_times() -> None:
    """Every byte of both directions, including invalid bytes."""
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


def test_commands() -> None:
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


def test_a_request_without_reply() -> None:
    """It has no latency, and its ending is counted."""
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
def test_outcome_of_a_run(
    pieces: list[bytes], outcome: str, code: str, duration_ms: float | None
) -> None:
    """A run lasts from the first reply to the final result, and has its code."""
    answers = [(at * MS, C2A, piece) for at, piece in enumerate(pieces, 2)]
    (run,) = session_of((1 * MS, A2C, request(0x30, b"a.rob")), *answers).runs
    assert (run.name, run.simulated, run.outcome, run.code) == ("a.rob", False, outcome, code)
    assert run.duration_ms == duration_ms


def test_an_emergency_stop_interrupts_a_run() -> None:
    """The run is shown as interrupted, whatever its own result is."""
    (run,) = session_of(
        (1 * MS, A2C, request(0x31, b"a.rob")),
        (2 * MS, C2A, reply(0x31, b"1")),
        (3 * MS, A2C, request(0x32)),
        (4 * MS, C2A, reply(0x32, b"1")),
        (5 * MS, C2A, reply(0x31, b"00|00", tagged=True)),
        (6 * MS, C2A, reply(0x32, b"11", tagged=True)),
    ).runs
    assert (run.simulated, run.outcome, run.code) == (True, "interrupted", "00")


def test_transfers(audited: Callable[[str], Results]) -> None:
    """Name, size and state of each."""
    session = audited("complaint-3").session
    assert session
    assert [
        (t.name, t.upload, t.size_bytes, t.received_bytes, t.state) for t in session.transfers
    ] == [("big.bin", True, 76800, 76800, "done"), ("big.bin", False, 76800, 76800, "done")]


def test_losses(audited: Callable[[str], Results]) -> None:
    """A capture with gaps lists each gap."""
    session = audited("plant-a-torn").session
    assert session
    assert len(session.losses) == 4
    assert all(loss.connection and loss.note for loss in session.losses)


def test_lists_are_bounded() -> None:
    """Further entries are counted."""
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


def test_no_session_without_events() -> None:
    """Missing values are not shown as zeros."""
    assert SessionStats().session() is None
