"""Injected faults in a recording, and how the judge treats them."""

import asyncio
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Finding, Verdict
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame
from scaraspec.report.session import SessionStats
from scaraspec.traffic.events import Injected
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.fault_injection.rules import Injection
from scaraspec_recorder.recording import record
from scaraspec_recorder.recordings.capture import capture_sink
from scaraspec_recorder.sinks import text as event_text
from scaraspec_recorder.sources.mcap_reader import read_mcap
from scaraspec_recorder.tap.routes import Upstream

TIMEOUT_S = 20

ASK = Frame(A2C, 0x09).encode()  # get_status
IDLE = Frame(C2A, 0x09, b"00").encode()

Load = Callable[[str], Injection]


def verdicts(events: Iterable[WireEvent]) -> list[tuple[Verdict, str]]:
    judge = Judge()
    items = [item for event in events for item in judge.feed(event)] + [*judge.close()]
    return [(item.verdict, item.requirement) for item in items if isinstance(item, Finding)]


def unanswered(talk: Any, *, injected: bool) -> None:
    """Add a request without a reply, and later some with replies."""
    talk.ask("get_version")
    if injected:
        talk.mark(A2C, Kind.INJECTED, "get_version request at bytes 14-17: rule 1: not passed on")
    for _ in range(4):
        talk.time_ns += 6_000_000_000
        talk.ask("get_status", None, "00")


def test_an_injected_fault_causes_no_failure(new_talk: Callable[[], Any]) -> None:
    """Without the injected fault the same silence is a failure, for each of two requests."""
    failed = []
    for first, second in ((False, False), (True, False), (True, True)):
        talk = new_talk()
        talk.mark(A2C, Kind.OPENED)
        talk.ask("login", b"password", reply=True)
        unanswered(talk, injected=first)
        unanswered(talk, injected=second)
        failed.append([found for found in verdicts(talk.events) if found[0] is Verdict.FAIL])
    without, once, both = failed
    assert len(without) == 2 * len(once) > 0
    assert both == []


def test_no_dropped_request_causes_a_failure(shift: list[WireEvent]) -> None:
    """The controller did not receive the request, and the client continues as recorded."""
    before = Counter(verdicts(shift))
    requests = [
        at
        for at, (event, after) in enumerate(pairwise(shift))
        if event.kind is after.kind is Kind.BYTES
        and (event.direction, after.direction) == (A2C, C2A)
    ]
    blamed = []
    for at in [*requests[:4], *requests[4:-3:40], *requests[-3:]]:
        injected = replace(shift[at], kind=Kind.INJECTED, data=b"", note="dropped")
        for printed in ([injected], []):
            found = Counter(verdicts([*shift[: at + 1], *printed, *shift[at + 2 :]])) - before
            if Verdict.FAIL in {verdict for verdict, _ in found}:
                blamed.append((at, printed))
    assert blamed
    assert [at for at, printed in blamed if printed] == []


def test_faults_in_the_log() -> None:
    """The faults are in the log of the recording and of the viewer."""
    event = WireEvent(7, "3", C2A, Kind.INJECTED, note="get_status reply: rule 1: not passed on")
    assert event_text.log_line(Injected(event)) == (
        event_text.Level.WARN,
        "injected",
        "connection 3 injected: get_status reply: rule 1: not passed on",
    )


def test_a_session_counts_faults_by_connection(talk: Any) -> None:
    """The counts of faults are by connection, with the addresses."""
    talk.mark(A2C, Kind.OPENED, "a > b")
    unanswered(talk, injected=True)
    unanswered(talk, injected=True)
    judge, stats = Judge(), SessionStats()
    for event in talk.events:
        for item in judge.feed(event):
            stats.add(item)
    session = stats.session()
    assert session
    assert [c.note for c in session.connections] == ["a > b; injected faults: 2"]


def test_faults_in_a_recording(load: Load, tmp_path: Path) -> None:
    """From the rule to the file, through all processes: the original raw bytes, and each fault."""
    injection = load('[[rule]]\nfault = "drop"\npart = "request"\nnth = 2\n')
    status = BY_NAME["get_status"]
    sink = partial(capture_sink, session={}, draw=False)

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while await reader.read(4):
            writer.write(Frame(C2A, status.opcode, b"00").encode())
        writer.close()

    async def test() -> None:
        server = await asyncio.start_server(answer, "127.0.0.1")
        route = Upstream(*server.sockets[0].getsockname())
        listen = [("127.0.0.1", 0)]
        async with (
            server,
            record(route, listen, tmp_path / "out", [sink], injection=injection) as recording,
        ):
            reader, writer = await asyncio.open_connection(*recording.address)
            writer.write(ASK)
            assert await reader.readexactly(len(IDLE)) == IDLE
            writer.write(ASK + ASK)
            writer.write_eof()
            assert await reader.read() == IDLE
            writer.close()
            await writer.wait_closed()
        assert recording.progress.problems == []

    asyncio.run(asyncio.wait_for(test(), TIMEOUT_S))
    events = list(read_mcap(tmp_path / "out" / "capture.mcap"))
    assert b"".join(e.data for e in events if e.direction is A2C) == 3 * ASK
    (fault,) = (event for event in events if event.kind is Kind.INJECTED)
    assert fault.note == "get_status request at bytes 4-7: rule 1: not passed on"
