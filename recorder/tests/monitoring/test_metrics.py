"""Metrics of recordings, only for programs on the same computer."""

import socket
import urllib.request
from pathlib import Path

import pytest

from scaraspec_recorder.monitoring.status import Status
from scaraspec_recorder.recordings.upload_log import UploadState
from scaraspec_recorder.sinks.sink_runner import Progress
from scaraspec_recorder.spool.event_builder import ByteCounts

metrics = pytest.importorskip("scaraspec_recorder.monitoring.metrics")

STATUS = Status(
    name="line-3",
    listen=(("127.0.0.1", 8877),),
    out_dir=Path("captures"),
    time_s=0,
    progress=Progress(3, ByteCounts(70, 30, 2), ByteCounts(500), ["a.mcap"], ["disk full"]),
    waiting_bytes=4096,
    silent_s=1.5,
    free_bytes=123_456,
    uploads=UploadState(waiting=2, waiting_bytes=700),
)


def test_a_scrape_returns_all_metrics() -> None:
    """Counters by robot and sender, gauges by robot; the status is read at the scrape."""
    statuses: list[Status] = []
    with metrics.serve("127.0.0.1", 0, lambda: statuses) as (host, port):
        statuses.append(STATUS)
        with urllib.request.urlopen(f"http://{host}:{port}/metrics", timeout=30) as answer:
            lines = answer.read().decode().splitlines()
    for line in (
        'scaraspec_received_bytes_total{robot="line-3",sender="client"} 100.0',
        'scaraspec_recorded_bytes_total{robot="line-3",sender="client"} 70.0',
        'scaraspec_gap_bytes_total{robot="line-3",sender="client"} 30.0',
        'scaraspec_gaps_total{robot="line-3",sender="client"} 2.0',
        'scaraspec_received_bytes_total{robot="line-3",sender="controller"} 500.0',
        'scaraspec_connections_total{robot="line-3"} 3.0',
        'scaraspec_files_total{robot="line-3"} 1.0',
        'scaraspec_problems{robot="line-3"} 1.0',
        'scaraspec_waiting_bytes{robot="line-3"} 4096.0',
        'scaraspec_silent_seconds{robot="line-3"} 1.5',
        'scaraspec_free_bytes{robot="line-3"} 123456.0',
        'scaraspec_archive_waiting_files{robot="line-3"} 2.0',
        'scaraspec_archive_waiting_bytes{robot="line-3"} 700.0',
    ):
        assert line in lines


@pytest.mark.parametrize("host", ["0.0.0.0", "192.0.2.7", "example.invalid"])
def test_only_loopback_addresses_are_allowed(host: str) -> None:
    """An address that other computers can reach is refused."""
    with (
        pytest.raises(metrics.MetricsError, match="served only on this machine"),
        metrics.serve(host, 0, list),
    ):
        pass


def test_a_port_in_use() -> None:
    """The error is raised before the recording starts."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with (
            pytest.raises(metrics.MetricsError, match=f"127.0.0.1:{port}: Address already in use"),
            metrics.serve("127.0.0.1", port, list),
        ):
            pass
