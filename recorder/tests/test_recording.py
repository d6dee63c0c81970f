"""A recording of three processes: link and recording survive the kill of each of them."""

import asyncio
import os
import pickle
import random
import select
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, Self

import pytest

import journal
from scaraspec_recorder.child_process import ChildProcess
from scaraspec_recorder.recording import Recording, record
from scaraspec_recorder.sinks.sink import SinkFactory
from scaraspec_recorder.sinks.sink_runner import Progress
from scaraspec_recorder.spool import locks
from scaraspec_recorder.spool.spool import replace_state
from scaraspec_recorder.tap.routes import Upstream

TIMEOUT_S = 30
pytestmark = pytest.mark.skipif(
    not hasattr(os, "pidfd_open"), reason="waits for processes by pidfd"
)


@pytest.fixture(autouse=True)
def spools_in_test_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put the spools into the folder of the test."""
    monkeypatch.setattr(locks, "_has_room", lambda _size_bytes: False)


def run(test: Callable[[], Awaitable[None]]) -> None:
    asyncio.run(asyncio.wait_for(test(), TIMEOUT_S))


@asynccontextmanager
async def echo() -> AsyncIterator[Upstream]:
    """Run a server that sends everything back, and ends after the client has ended."""

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(ConnectionError):  # a test has killed the tap
            while data := await reader.read(1 << 16):
                writer.write(data)
                await writer.drain()
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1")
    async with server:
        yield Upstream(*server.sockets[0].getsockname())


@asynccontextmanager
async def session(out_dir: Path, sink: SinkFactory) -> AsyncIterator[Recording]:
    """Record the connections to an echo server."""
    async with echo() as route, record(route, [("127.0.0.1", 0)], out_dir, [sink]) as recording:
        yield recording


class Client:
    """Sends random bytes and checks that they come back."""

    def __init__(self, address: tuple[str, int], seed: int = 1) -> None:
        self.sent = b""
        self._address = address
        self._dice = random.Random(seed)

    async def __aenter__(self) -> Self:
        self._reader, self._writer = await asyncio.open_connection(*self._address)
        return self

    async def __aexit__(self, *_: object) -> None:
        self._writer.close()
        with suppress(ConnectionError):  # the tap was killed
            await self._writer.wait_closed()

    async def exchange(self, count: int, size_bytes: int = 50) -> None:
        for _ in range(count):
            data = self._dice.randbytes(size_bytes)
            self._writer.write(data)
            self.sent += data
            assert await self._reader.readexactly(size_bytes) == data

    async def finish(self) -> None:
        self._writer.write_eof()
        assert await self._reader.read() == b""

    async def wait_for_reset(self) -> None:
        """Wait until the connection is reset."""
        with suppress(ConnectionError):
            assert await self._reader.read() == b""


def streams(lines: list[list]) -> dict[tuple[str, str], bytes]:
    """Join the bytes of each stream in journals; duplicate bytes must be equal."""
    whole: dict[tuple[str, str], bytearray] = {}
    for name, way, kind, data, offset, *_ in lines:
        stream = whole.setdefault((name, way), bytearray())
        if kind == "bytes":
            piece = bytes.fromhex(data)
            assert offset <= len(stream), "a hole that no gap accounts for"
            assert stream[offset : offset + len(piece)] == piece[: len(stream) - offset]
            stream[offset : offset + len(piece)] = piece
    return {key: bytes(stream) for key, stream in whole.items()}


def _is_readable(descriptor: int) -> bool:
    return bool(select.select([descriptor], [], [], 0)[0])


def _has_recorded(recording: Recording, size_bytes: int) -> bool:
    return recording.progress.a2c.recorded_bytes == size_bytes


async def wait_until(condition: Callable[[], Any]) -> None:
    """Wait for another process; the timeout of the test applies."""
    while not condition():
        await asyncio.get_running_loop().run_in_executor(None, select.select, [], [], [], 0.01)


async def kill(child: ChildProcess) -> None:
    """Kill a process, and wait until the recorder has restarted it."""
    old = child.pid
    assert old
    os.kill(old, signal.SIGKILL)
    await wait_until(lambda: child.pid != old)


def test_a_session_is_recorded_completely(tmp_path: Path) -> None:
    """Both directions byte for byte; the spool is removed, and the progress has all counts."""

    async def test() -> None:
        async with (
            session(tmp_path, journal.Journal) as recording,
            Client(recording.address) as client,
        ):
            await client.exchange(300)
            await client.exchange(3, 300_000)
            await client.finish()
        sent = client.sent
        assert streams(journal.lines(tmp_path)) == {("1", "A2C"): sent, ("1", "C2A"): sent}
        progress = recording.progress
        assert progress.finished
        assert progress.connections == 1
        assert progress.a2c.recorded_bytes == progress.c2a.received_bytes == len(sent)
        assert (progress.a2c.gaps, progress.problems) == (0, [])
        assert progress.files == ["journal.jsonl"]

    run(test)
    assert [path.name for path in tmp_path.iterdir()] == ["journal.jsonl"]


def test_open_connections_end_with_the_recording(tmp_path: Path) -> None:
    """The note states that the recorder ended them, not a side of the link."""

    async def test() -> None:
        async with session(tmp_path, journal.Journal) as recording:
            client = await Client(recording.address).__aenter__()
            await client.exchange(1)
        await client.wait_for_reset()
        await client.__aexit__()
        name, _, kind, *_, note = journal.lines(tmp_path)[-1]
        assert (name, kind, note) == ("1", "closed", "the recorder stopped")

    run(test)


def test_an_interrupted_recording_is_finished(tmp_path: Path) -> None:
    """An exception in the caller, such as Ctrl-C, leaves a finished recording."""
    made: list[Recording] = []

    async def break_off() -> None:
        async with session(tmp_path, journal.Journal) as recording:
            made.append(recording)
            async with Client(recording.address) as client:
                await client.exchange(10)
            raise KeyError

    with pytest.raises(KeyError):
        run(break_off)
    assert made[0].progress.finished
    assert len(streams(journal.lines(tmp_path))["1", "A2C"]) == 500
    assert [path.name for path in tmp_path.iterdir()] == ["journal.jsonl"]


def test_a_killed_writer_loses_nothing(tmp_path: Path) -> None:
    """Repeated SIGKILL under traffic: the link is unaffected, and every byte is recorded."""

    async def test() -> None:
        async with (
            session(tmp_path, journal.Journal) as recording,
            Client(recording.address) as client,
        ):
            for _ in range(3):
                await client.exchange(200)
                await wait_until(lambda: recording.progress.a2c.recorded_bytes)
                killed = asyncio.create_task(kill(recording.writer))
                while not killed.done():
                    await client.exchange(20)
            await client.finish()
        sent = client.sent
        assert streams(journal.lines(tmp_path)) == {("1", "A2C"): sent, ("1", "C2A"): sent}
        progress = recording.progress
        assert (progress.a2c.recorded_bytes, progress.a2c.gaps) == (len(sent), 0)
        assert len(progress.files) >= 2

    run(test)


def test_a_killed_tap_loses_only_its_connections(tmp_path: Path) -> None:
    """SIGKILL under traffic: what was spooled is complete, the rest is reported, and the next
    connection to the same address is recorded."""

    async def talk(client: Client) -> None:
        with suppress(ConnectionError, asyncio.IncompleteReadError):
            while True:
                await client.exchange(1)

    async def test() -> None:
        async with session(tmp_path, journal.Journal) as recording:
            async with Client(recording.address) as first:
                talking = asyncio.create_task(talk(first))
                await wait_until(lambda: recording.progress.a2c.recorded_bytes)
                known = recording.progress.a2c.recorded_bytes
                await kill(recording.tap)
                await talking
            async with Client(recording.address, seed=2) as second:
                await second.exchange(10)
                await second.finish()
        lines = journal.lines(tmp_path)
        whole = streams(lines)
        for way in ("A2C", "C2A"):
            assert first.sent.startswith(whole["1", way])
            assert whole["2", way] == second.sent
        assert len(whole["1", "A2C"]) >= known > 0
        gaps = [(name, way, length) for name, way, kind, _, _, length, _ in lines if kind == "gap"]
        assert gaps == [("1", "A2C", -1), ("1", "C2A", -1)]

    run(test)


def test_a_temporarily_full_disk_loses_nothing(tmp_path: Path) -> None:
    """Sinks fail and are created again until they can write; the spool keeps the events."""
    (tmp_path / "full").touch()

    async def test() -> None:
        async with (
            session(tmp_path, journal.Trouble) as recording,
            Client(recording.address) as client,
        ):
            await client.exchange(300)
            await wait_until((tmp_path / "refused").exists)
            await client.exchange(300)
            assert recording.progress.a2c.recorded_bytes == 0
            (tmp_path / "full").unlink()
            await wait_until(lambda: recording.progress.a2c.recorded_bytes)
            await client.finish()
        assert recording.progress.a2c.recorded_bytes == len(client.sent)
        assert recording.progress.a2c.gaps == 0

    run(test)


def test_an_unfinished_writer_leaves_its_spool_to_the_next(tmp_path: Path) -> None:
    """If the writer fails repeatedly, the recording ends, and the next recorder writes the rest."""
    (tmp_path / "full").touch()

    async def test() -> None:
        async with echo() as upstream:
            listen = [("127.0.0.1", 0)]
            async with (
                record(upstream, listen, tmp_path, [journal.Trouble]) as recording,
                Client(recording.address) as client,
            ):
                await client.exchange(100)
                await client.finish()
            progress = recording.progress
            assert not progress.finished
            assert progress.a2c.received_bytes == progress.a2c.spooled_bytes == len(client.sent)
            (tmp_path / "full").unlink()
            async with record(upstream, listen, tmp_path, [journal.Trouble]) as recording:
                pass
        assert recording.progress.finished
        assert recording.progress.a2c.recorded_bytes == len(client.sent)

    run(test)


def test_bytes_that_cannot_be_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The recording ends nevertheless, with its last counts."""
    (tmp_path / "full").touch()
    monkeypatch.setattr("scaraspec_recorder.recording.count_unwritten", _without_memory)

    async def test() -> None:
        async with session(tmp_path, journal.Trouble) as recording:
            pass
        assert not recording.progress.finished
        assert recording.progress.problems == [
            "the bytes that are not written yet cannot be counted: there is not enough memory"
        ]

    run(test)


def _without_memory(_spool: Path) -> Progress:
    raise MemoryError


def test_a_finished_recording_of_a_killed_recorder(tmp_path: Path) -> None:
    """It is not mistaken for the present one, whose spool remains."""
    (tmp_path / "full").touch()
    finished = Progress(connections=7, finished=True)
    replace_state(locks.spool_folder(tmp_path), {"progress": asdict(finished)})

    async def test() -> None:
        async with session(tmp_path, journal.Trouble) as recording:
            assert recording.progress == Progress()
            async with Client(recording.address) as client:
                await client.exchange(10)
                await client.finish()
        progress = recording.progress
        assert not progress.finished
        assert progress.connections == 1
        assert progress.a2c.received_bytes == progress.a2c.spooled_bytes == len(client.sent)
        assert recording.spool.exists()

    run(test)


def test_a_removed_spool_is_reported(tmp_path: Path) -> None:
    """The counts may be incomplete."""

    async def test() -> None:
        async with session(tmp_path, journal.Journal) as recording:
            shutil.rmtree(recording.spool)
        (problem,) = recording.progress.problems
        assert problem.startswith(f"{recording.spool} was removed during the recording: ")

    run(test)


def test_a_suspended_writer_is_continued_at_the_end(tmp_path: Path) -> None:
    """Otherwise the end would wait for it."""

    async def test() -> None:
        async with (
            session(tmp_path, journal.Journal) as recording,
            Client(recording.address) as client,
        ):
            await client.exchange(10)
            await client.finish()
            await wait_until(lambda: recording.writer.pid)
            assert recording.writer.pid
            os.kill(recording.writer.pid, signal.SIGSTOP)
        assert recording.progress.finished
        assert recording.progress.a2c.recorded_bytes == len(client.sent)

    run(test)


def test_a_folder_has_one_recorder(tmp_path: Path) -> None:
    """A second recorder gets an error of one sentence."""

    async def test() -> None:
        route, listen = Upstream("127.0.0.1", 1), [("127.0.0.1", 0)]
        async with record(route, listen, tmp_path, [journal.Journal]):
            with pytest.raises(BlockingIOError, match="another recorder writes into"):
                async with record(route, listen, tmp_path, [journal.Journal]):
                    pytest.fail("two recorders share a folder")

    run(test)


def test_an_address_in_use(tmp_path: Path) -> None:
    """The error is raised before any process is started."""

    async def start(address: tuple[str, int]) -> None:
        async with record(Upstream("127.0.0.1", 1), [address], tmp_path, [journal.Journal]):
            pytest.fail("two listen on one address")

    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(OSError, match="in use"):
        asyncio.run(start(taken.getsockname()))
    assert list(tmp_path.iterdir()) == []


def test_a_sink_that_cannot_be_pickled(tmp_path: Path) -> None:
    """The error is raised at the start."""

    async def start() -> None:
        sinks: list[Any] = [lambda _folder: None]
        async with record(Upstream("127.0.0.1", 1), [("127.0.0.1", 0)], tmp_path, sinks):
            pytest.fail("a local function cannot be pickled")

    with pytest.raises((AttributeError, pickle.PicklingError)):
        asyncio.run(start())


def test_child_processes_ignore_signals(tmp_path: Path) -> None:
    """Ctrl-C in a terminal reaches every process; only the recorder decides when they end."""

    async def test() -> None:
        async with session(tmp_path, journal.Journal) as recording:
            async with Client(recording.address) as client:
                await client.exchange(10)
                await wait_until(lambda: recording.progress.a2c.recorded_bytes)
                pids = (recording.tap.pid, recording.writer.pid)
                for pid in filter(None, pids):
                    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                        os.kill(pid, number)
                await client.exchange(10)
                await client.finish()
            assert (recording.tap.pid, recording.writer.pid) == pids
        assert recording.progress.a2c.recorded_bytes == len(client.sent)
        assert recording.progress.files == ["journal.jsonl"]

    run(test)


RECORDER = """
import asyncio, pathlib, sys
sys.path.insert(0, sys.argv[1])
import journal
from scaraspec_recorder import recording
from scaraspec_recorder.tap.routes import Upstream
from scaraspec_recorder.sinks.sink import SinkFactory
from scaraspec_recorder.spool import locks as claims

async def main():
    claims._has_room = lambda _: False
    route = Upstream("127.0.0.1", int(sys.argv[2]))
    out_dir = pathlib.Path(sys.argv[3])
    async with recording.record(route, [("127.0.0.1", 0)], out_dir, [journal.Journal]) as made:
        while not (made.tap.pid and made.writer.pid):
            await asyncio.sleep(0)
        print(made.address[1], made.tap.pid, made.writer.pid, flush=True)
        await asyncio.Event().wait()

if __name__ == "__main__":
    asyncio.run(main())
"""


def test_a_killed_recorder_leaves_a_finished_recording(tmp_path: Path) -> None:
    """The processes detect it, end the connections, write the rest and exit."""
    program = tmp_path / "program.py"
    program.write_text(RECORDER)
    out_dir = tmp_path / "out"

    async def test() -> None:
        async with echo() as upstream:
            arguments = (str(Path(journal.__file__).parent), str(upstream.port), str(out_dir))
            recorder = await asyncio.create_subprocess_exec(
                sys.executable, program, *arguments, stdout=subprocess.PIPE
            )
            assert recorder.stdout
            port, *pids = map(int, (await recorder.stdout.readline()).split())
            watches = [os.pidfd_open(pid) for pid in pids]
            async with Client(("127.0.0.1", port)) as client:
                await client.exchange(200)
                os.kill(pids[0], signal.SIGSTOP)
                recorder.kill()
                assert not select.select([watches[1]], [], [], 0.5)[0], (
                    "the scribe outlives the tap"
                )
                os.kill(pids[0], signal.SIGCONT)
                await client.wait_for_reset()
            for watch in watches:
                await wait_until(partial(_is_readable, watch))
                os.close(watch)
            await recorder.communicate()
        lines = journal.lines(out_dir)
        assert streams(lines)["1", "A2C"] == client.sent
        assert (lines[-1][2], lines[-1][-1]) == ("closed", "the recorder stopped")
        assert "gap" not in [kind for _, _, kind, *_ in lines]

    run(test)


def test_processes_share_no_interpreter_with_the_caller(tmp_path: Path) -> None:
    """Neither the caller nor the writer process can slow down the tap."""

    async def test() -> None:
        async with record(
            Upstream("127.0.0.1", 1), [("127.0.0.1", 0)], tmp_path, [journal.Journal]
        ) as recording:
            await wait_until(lambda: recording.tap.pid and recording.writer.pid)
            assert len({os.getpid(), recording.tap.pid, recording.writer.pid}) == 3

    run(test)


def test_progress_during_a_recording(tmp_path: Path) -> None:
    """The progress is available while the recording runs."""

    async def test() -> None:
        async with session(tmp_path, journal.Journal) as recording:
            assert isinstance(recording, Recording)
            async with Client(recording.address) as client:
                for count in (1, 2, 3):
                    await client.exchange(1)
                    await wait_until(partial(_has_recorded, recording, 50 * count))

    run(test)
