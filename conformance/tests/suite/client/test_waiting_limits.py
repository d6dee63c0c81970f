"""Missing answers do not cost the full timeout in every case."""

from contextlib import closing

import pytest

from scaraspec.client import AsyncClient
from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.client import mutants
from scaraspec.mutants.client_run import MemoryClient, prove_client
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.client.harness.adapter import ClientAdapter
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run

ONLY = frozenset({"5.1/1", "5.1/2", "5.1/3", "5.1/4"})
TRANSFERS = frozenset({"5.1/1", "5.1/4", "5.1/12", "5.2/5", "5.3/1", "5.3/5", "5.3/11"})
LATE = (0x52, 0x56)  # the answer to a chunk, and a chunk


def test_missing_reports_use_two_full_timeouts() -> None:
    """After two full timeouts for an operation, later waits are short."""
    silent = mutants()["waits-behind-the-last-answer"].wrong
    with closing(MemoryClient(silent, DEFAULT)) as access:
        options = Options(only=ONLY, allowed=ALL, examples=1)
        results = Run(ClientAdapter(access, Ics(), options)).results()
    reported = [case.message for case in results.cases if case.verdict is Verdict.FAIL]
    in_full = [message for message in reported if "within 10 s" in message]
    assert len(reported) == len(ONLY)
    assert len(in_full) == 2


def test_a_slow_computer_causes_no_failures(monkeypatch: pytest.MonkeyPatch) -> None:
    """An aborted transfer is inconclusive if the suite itself was silent for too long."""
    in_time = IncomingConnection.send_frame

    def late(line: IncomingConnection, frame: Frame) -> None:
        if frame.opcode in LATE:
            line.wait(1.2)
        in_time(line, frame)

    monkeypatch.setattr(IncomingConnection, "send_frame", late)
    dialect = DEFAULT.replace(xfer_timeout="1")
    with closing(MemoryClient(AsyncClient, dialect)) as access:
        options = Options(only=TRANSFERS, allowed=ALL, examples=1)
        results = Run(ClientAdapter(access, Ics(dialect=dialect), options)).results()
    undecided = [case for case in results.cases if case.verdict is Verdict.INCONCLUSIVE]
    assert results.counts[Verdict.FAIL] == 0
    assert len(undecided) > len(TRANSFERS)
    assert all("this machine is too slow" in case.message for case in undecided)


def test_part_of_a_list_that_comes_after_the_reply_timeout() -> None:
    """A client with a timeout of 1 s gets the pushed part before it requests the next one."""
    dialect = DEFAULT.replace(reply_timeout="1")
    results = prove_client(Options(only=frozenset({"2/6"}), allowed=ALL), None, dialect)
    assert not [case for case in results.cases if case.verdict is Verdict.FAIL]
