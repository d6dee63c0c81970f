"""The blocking client: connection, waiting, several threads, files."""

import queue
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from scaraspec.client import (
    Client,
    Failed,
    Interrupted,
    LinkLost,
    LoginFailed,
    ReplyTimeout,
    TransferFailed,
)
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.readings import DEFAULT
from scaraspec.protocol.transfer import FILE_DATA, chunks_of
from scaraspec.transports.link import Ending
from scaraspec.transports.tcp import SocketLink
from scaraspec.transports.url import UrlError

ANSWER_WITHIN_S = 20  # a limit for tests that hang, much longer than a test takes


def c2a(opcode: int, data: bytes = b"", *, tagged: bool = False) -> bytes:
    """A frame of the controller."""
    return Frame(C2A, opcode, data, tagged).encode()


def polite(opcode: int, _data: bytes) -> list[tuple[float, Any]]:
    """A controller that accepts everything; a program runs for an hour."""
    if opcode == 0x30:
        return [(0.1, c2a(0x30, b"1")), (3600, c2a(0x30, b"11", tagged=True))]
    if opcode == 0x54:
        chunk = next(chunks_of(b"content"))
        return [(0.1, c2a(0x54, b"1")), (0.2, c2a(0x56, FILE_DATA.encode(chunk, DEFAULT)))]
    return [] if opcode == 0x56 else [(0.1, c2a(opcode, b"00" if opcode == 0x09 else b"1"))]


def test_a_flood_does_not_extend_the_timeout(scripted_link: Any) -> None:
    """A peer that never stops sending is timed out like a silent one."""

    def flood(opcode: int, data: bytes) -> list[tuple[float, Any]]:
        return polite(opcode, data) if opcode == 0x01 else [(0.1, b"\xcc\x09\xff")] * 600

    link = scripted_link(flood)
    with Client(link, password="p") as client:
        begun_s = link.now_s
        with pytest.raises(ReplyTimeout, match="get_status got no reply within 5 s"):
            client.get_status()
        assert link.now_s - begun_s <= 5.2


def test_with_connects_logs_in_and_closes(scripted_link: Any) -> None:
    """2/10: the login is the first request."""
    link = scripted_link(polite)
    with Client(link, password="secret") as client:
        assert client.get_status().code == "00"
    assert link.requests == [(0x01, b"secret"), (0x09, b"")]
    assert link.closed
    with pytest.raises(LinkLost, match="this client was closed"):
        client.get_status()
    client.close()


def test_a_failed_login_closes(scripted_link: Any) -> None:
    """4.1/5: nothing else is sent."""
    link = scripted_link(lambda opcode, _: [(0, c2a(opcode, b"0"))])
    with pytest.raises(LoginFailed), Client(link, password=b"wrong"):
        pytest.fail("the controller refused the password")
    assert link.closed
    assert link.requests == [(0x01, b"wrong")]


def test_calls_before_connecting_fail() -> None:
    """The message asks to connect first."""
    client = Client("tcp://127.0.0.1")
    with pytest.raises(LinkLost, match="call connect"):
        client.login("password")
    client.close()


def test_failed_connection_raises_link_lost() -> None:
    """The message is one sentence with the address."""
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
        with pytest.raises(LinkLost, match=f"127.0.0.1:{port}"), Client(f"tcp://127.0.0.1:{port}"):
            pytest.fail("nothing listens there")


def test_invalid_url_is_rejected_immediately() -> None:
    """Before anything is opened."""
    with pytest.raises(UrlError):
        Client("robot.local")


def test_no_login_is_needed_over_a_serial_line() -> None:
    """Over a serial line the client counts as logged in (L83)."""
    assert Client("serial:///dev/rfcomm0")._core.logged_in
    assert not Client("tcp://127.0.0.1")._core.logged_in


def test_reply_or_timeout(scripted_link: Any) -> None:
    """A-3-15: 5 s, in the time of the link; the link stays usable."""
    silent = [True, False]
    link = scripted_link(lambda *frame: [] if silent.pop(0) else polite(*frame))
    client = Client(link)
    client._core.logged_in = True
    began_s = link.now_s
    with pytest.raises(ReplyTimeout):
        client.get_status()
    assert link.now_s - began_s == pytest.approx(5)
    assert client.get_version() == "1"


def test_the_link_ends_if_a_reply_cannot_be_assigned(scripted_link: Any) -> None:
    """One reply comes for two requests; the client then closes the link."""
    silent = [True, False]
    link = scripted_link(lambda *frame: [] if silent.pop(0) else polite(*frame))
    client = Client(link)
    client._core.logged_in = True
    for _ in range(2):
        with pytest.raises(ReplyTimeout):
            client.get_status()
    assert link.closed
    with pytest.raises(LinkLost, match="replies to get_status came late"):
        client.get_version()


@pytest.mark.parametrize("ending", Ending)
def test_link_end_raises_link_lost(scripted_link: Any, ending: Ending) -> None:
    """Calls in progress and later calls raise it."""
    client = Client(scripted_link(lambda *_: [(1, ending)]))
    client._core.logged_in = True
    for _ in range(2):
        with pytest.raises(LinkLost, match=r"the controller (closed|reset) the connection"):
            client.get_status()


def test_a_two_stage_operation_waits_for_its_result(scripted_link: Any) -> None:
    """4/11: an hour, in simulated time."""
    link = scripted_link(polite)
    with Client(link, password="p") as client:
        began_s = link.now_s
        assert client.run_program("a.rob") is None
        assert link.now_s - began_s == pytest.approx(3600)


def test_other_commands_work_while_one_is_pending(scripted_link: Any) -> None:
    """A-4-3; `wait` accepts a timeout and can be repeated."""
    with Client(scripted_link(polite), password="p") as client:
        pending = client.start_run_program("a.rob")
        assert (pending.accepted, pending.done) == (True, False)
        assert client.get_status().code == "00"
        with pytest.raises(ReplyTimeout, match=r"no final result after 10 s: .* get_status"):
            pending.wait(10)
        pending.wait()
        assert pending.done


def test_a_pending_command_raises_its_refusal(scripted_link: Any) -> None:
    """4/13: it is done and was not accepted."""
    client = Client(scripted_link(lambda opcode, _: [(0, c2a(opcode, b"0|01"))]))
    client._core.logged_in = True
    pending = client.start_jog("+x")
    assert (pending.accepted, pending.done) == (False, True)
    with pytest.raises(Exception, match="jog was refused: 01, running a program"):
        pending.wait()


def test_missing_first_reply_raises_a_timeout(scripted_link: Any) -> None:
    """It is unknown whether the command was accepted."""
    client = Client(scripted_link(lambda *_: []))
    client._core.logged_in = True
    with pytest.raises(ReplyTimeout):
        client.start_reset()


def test_observed_readings_and_remarks(scripted_link: Any) -> None:
    """They are properties of the client."""
    client = Client(scripted_link(lambda opcode, _: [(0, b"?" + c2a(opcode, b"0a"))]))
    client._core.logged_in = True
    assert client.list_programs() == ("a",)
    assert client.observed_readings == {"list_prefix_sep": {"0a"}}
    assert client.remarks == ("1 bytes are not a frame (stray)",)


def test_progress_is_reported(scripted_link: Any, tmp_path: Path) -> None:
    """The callback is called after every chunk, with the file size."""
    printed: list[tuple[int, int | None]] = []
    with Client(scripted_link(polite), password="p") as client:
        client.upload_bytes(b"x" * 500, "a.rob", lambda *progress: printed.append(progress))
        client.download("a.rob", tmp_path / "a.rob", lambda *progress: printed.append(progress))
    assert printed == [(200, 500), (400, 500), (500, 500), (7, 7)]
    assert (tmp_path / "a.rob").read_bytes() == b"content"


def test_a_download_goes_to_the_working_directory(
    scripted_link: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With its own name, if no other name is given."""
    monkeypatch.chdir(tmp_path)
    with Client(scripted_link(polite), password="p") as client:
        assert client.download("a.rob") == Path("a.rob")
        assert client.download_bytes("a.rob") == b"content"
    assert (tmp_path / "a.rob").read_bytes() == b"content"


def test_a_local_file_is_never_overwritten(scripted_link: Any, tmp_path: Path) -> None:
    """5.3/12: the transfer does not start."""
    (tmp_path / "a.rob").write_bytes(b"old")
    link = scripted_link(polite)
    with Client(link, password="p") as client:
        with pytest.raises(FileExistsError):
            client.download("a.rob", tmp_path / "a.rob")
        with pytest.raises(PayloadError):
            client.download("../a.rob", tmp_path / "b.rob")
    assert [opcode for opcode, _ in link.requests] == [0x01]


def test_a_failed_download_leaves_no_file(scripted_link: Any, tmp_path: Path) -> None:
    """5.2/19: not even a partial file."""
    chunk = next(chunks_of(b"x" * 500))
    first = c2a(0x54, b"1") + c2a(0x56, FILE_DATA.encode(chunk, DEFAULT))
    client = Client(scripted_link(lambda opcode, _: [(0, first)] if opcode == 0x54 else []))
    client._core.logged_in = True
    with pytest.raises(TransferFailed, match="no frame for 30 s"):
        client.download("a.rob", tmp_path / "a.rob")
    assert list(tmp_path.iterdir()) == []


class Stop(Exception):  # noqa: N818 - a test's own signal
    """Raised by a progress callback."""


def test_an_exception_from_progress_aborts_with_a_signal(scripted_link: Any) -> None:
    """L787: the client sends a chunk of length 0 and raises the exception again."""

    def stop(_moved: int, _total: int | None) -> None:
        raise Stop

    link = scripted_link(polite)
    with Client(link, password="p") as client:
        with pytest.raises(Stop):
            client.upload_bytes(b"x" * 900, "a.rob", stop)
        assert client.get_status().code == "00"
    chunks = [FILE_DATA.decode(data).value for opcode, data in link.requests if opcode == 0x52]
    assert [chunk.length for chunk in chunks] == [200, 200, 0]


class Stage:
    """A controller at the other end of a socket, controlled by the test's thread."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        theirs.settimeout(ANSWER_WITHIN_S)
        self.socket = theirs
        self.client = Client(SocketLink(ours))
        self.client._core.logged_in = True
        self._framer = Framer(A2C)
        self._threads: list[threading.Thread] = []

    def expect(self, opcode: int) -> None:
        """Wait for this request, and no other."""
        found: list[Any] = []
        while not found:
            found = self._framer.feed(self.socket.recv(4096))
        assert [frame.opcode for frame in found] == [opcode]

    def send_frame(self, opcode: int, data: bytes, *, tagged: bool = False) -> None:
        """Send a frame."""
        self.socket.sendall(c2a(opcode, data, tagged=tagged))

    def do(self, act: Callable[[], object]) -> "queue.Queue[Any]":
        """Call a function in another thread; return its result or raise its exception."""
        outcome: queue.Queue[Any] = queue.Queue()

        def run() -> None:
            try:
                outcome.put(act())
            except Exception as error:  # noqa: BLE001 - handed to the test
                outcome.put(error)

        thread = threading.Thread(target=run, daemon=True)
        self._threads.append(thread)
        thread.start()
        return outcome

    def end(self) -> None:
        """Close everything."""
        self.client.close()
        self.socket.close()
        for thread in self._threads:
            thread.join(ANSWER_WITHIN_S)
            assert not thread.is_alive()


@pytest.fixture
def stage() -> Iterator[Stage]:
    """A `Stage`, closed afterwards."""
    stage = Stage()
    yield stage
    stage.end()


def test_emergency_stop_during_a_waiting_call(stage: Stage) -> None:
    """4.17/10, 4.17/9: from another thread, while a query also waits for its reply."""
    run = stage.do(lambda: stage.client.run_program("a.rob"))
    stage.expect(0x30)
    stage.send_frame(0x30, b"1")
    status = stage.do(stage.client.get_status)
    stage.expect(0x09)
    halt = stage.do(stage.client.emergency_stop)
    stage.expect(0x32)
    stage.send_frame(0x32, b"1")
    stage.send_frame(0x30, b"00|00", tagged=True)
    stage.send_frame(0x32, b"11", tagged=True)
    assert halt.get(timeout=ANSWER_WITHIN_S) is None
    assert isinstance(run.get(timeout=ANSWER_WITHIN_S), Interrupted)
    stage.send_frame(0x09, b"00")
    assert status.get(timeout=ANSWER_WITHIN_S).code == "00"


def test_equal_requests_of_two_threads_are_serialised(stage: Stage) -> None:
    """3/25: the second is sent after the reply to the first."""
    first = stage.do(stage.client.get_status)
    stage.expect(0x09)
    second = stage.do(stage.client.get_status)
    stage.send_frame(0x09, b"00")
    assert first.get(timeout=ANSWER_WITHIN_S).code == "00"
    stage.expect(0x09)
    stage.send_frame(0x09, b"01")
    assert second.get(timeout=ANSWER_WITHIN_S).code == "01"


def test_closing_ends_every_call_that_waits(stage: Stage) -> None:
    """The call that receives, and the others."""
    run = stage.do(lambda: stage.client.run_program("a.rob"))
    stage.expect(0x30)
    stage.send_frame(0x30, b"1")
    jog = stage.do(lambda: stage.client.jog("+x"))
    stage.expect(0x3D)
    stage.client.close()
    for outcome in (run, jog):
        assert isinstance(outcome.get(timeout=ANSWER_WITHIN_S), LinkLost)


def test_a_failed_run_raises_its_code(stage: Stage) -> None:
    """The error contains the faulty joints."""
    run = stage.do(lambda: stage.client.run_program("a.rob"))
    stage.expect(0x30)
    stage.send_frame(0x30, b"1")
    stage.send_frame(0x30, b"00|13", tagged=True)
    error = run.get(timeout=ANSWER_WITHIN_S)
    assert isinstance(error, Failed)
    assert str(error) == "run_program failed: 13, motor fault: inner arm and outer arm"
