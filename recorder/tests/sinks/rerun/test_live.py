"""A slow or dead live viewer never delays the recording."""

import contextlib
import os
import pickle
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import draw_processes
from scaraspec.judge.judge import Judge
from scaraspec.protocol.direction import A2C
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.rerun import live
from scaraspec_recorder.sinks.rerun.live import LiveSink, live_sink
from scaraspec_recorder.sinks.sink import OutputFolder

LARGE = WireEvent(1, "1", A2C, Kind.BYTES, bytes(60_000))


def test_a_fast_process_gets_all_events(shift: list[WireEvent], tmp_path: Path) -> None:
    """In order, in many batches; the sink is closed when all are drawn."""
    path = tmp_path / "drawn"
    sink = LiveSink(draw_processes.collect, path)
    for number, event in enumerate(shift):
        sink.write(event)
        if number % 7 == 0:
            sink.tick(event.time_ns)
    sink.close()
    assert pickle.loads(path.read_bytes()) == shift
    assert sink.lost_events == 0


def test_a_hanging_process_loses_events(monkeypatch: pytest.MonkeyPatch) -> None:
    """The queue is bounded, dropped events are counted, and closing has a timeout."""
    monkeypatch.setattr(live, "CLOSE_TIMEOUT_S", 0.1)
    sink = LiveSink(draw_processes.hang, most_batches=3)
    for _ in range(1000):
        sink.write(LARGE)
    sink.close()
    assert 900 < sink.lost_events < 1000


def test_a_dead_process_is_ignored() -> None:
    """Writing, ticks and closing still work."""
    sink = LiveSink(draw_processes.die)
    sink._process.join()
    for number in range(1000):
        sink.write(LARGE)
        sink.tick(number)
    sink.close()
    sink._pump.join(live.CLOSE_TIMEOUT_S)  # it may still report the end of the process
    assert not sink._pump.is_alive()


@settings(max_examples=8)
@given(dice=st.randoms(use_true_random=False))
def test_any_dropped_events(shift: list[WireEvent], dice: Any) -> None:
    """Events after dropped ones are still decoded."""
    decoder = Decoder([], Judge())
    for event in shift:
        if dice.random() < 0.8:
            decoder.write(event)
    decoder.close()
    assert "defect" not in decoder.summary()


@contextlib.contextmanager
def viewer(saved: Path) -> Iterator[str]:
    """Run a server that receives a recording like a viewer, and saves it."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = (sys.executable, "-m", "rerun", "--serve-grpc", "--bind", "127.0.0.1")
    process = subprocess.Popen(
        [*command, "--port", str(port), "--save", str(saved)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # the interpreter is only a wrapper around the viewer
    )
    until_s = time.monotonic() + 30
    while time.monotonic() < until_s:
        with contextlib.suppress(OSError):
            socket.create_connection(("127.0.0.1", port), 0.1).close()
            break
    try:
        yield f"rerun+http://127.0.0.1:{port}/proxy"
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait()


def test_a_viewer_gets_the_recording(
    shift: list[WireEvent], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Plots, states and the log arrive over gRPC."""
    pytest.importorskip("rerun")
    monkeypatch.setattr(live, "CLOSE_TIMEOUT_S", 30)
    saved = tmp_path / "seen.rrd"
    with viewer(saved) as url:
        sink = live_sink(OutputFolder(tmp_path, []), url=url)
        for event in shift:
            sink.write(event)
        sink.tick(shift[-1].time_ns)
        sink.close()
    seen = saved.read_bytes()
    for entity in (b"joint/inner_arm", b"state/robot", b"tool/x"):
        assert entity in seen, entity
