"""Metrics: what recordings are doing, for Prometheus.

Law: read at each scrape, kept nowhere, and offered to this machine alone.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager

from scaraspec.user_message import UserMessage
from scaraspec_recorder.monitoring.status import Status
from scaraspec_recorder.tap.tcp import is_loopback

try:
    from prometheus_client import CollectorRegistry, start_http_server
    from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
    from prometheus_client.registry import Collector
except ImportError:
    raise ImportError("metrics need the extra: pip install 'scaraspec[metrics]'") from None

_WAYS = (("client", "a2c"), ("controller", "c2a"))


class MetricsError(Exception):
    """Metrics cannot be offered there; the message is one sentence for the user."""


@contextmanager
def serve(host: str, port: int, look: Callable[[], Sequence[Status]]) -> Iterator[tuple[str, int]]:
    """Answer scrapes for as long as the context lasts; give host and port, which may have been 0.

    Args:
        host: An address that only this machine can reach.
        port: Where to; 0 takes a free one.
        look: Gives the present status of all recordings; called in a thread of its own.

    Raises:
        MetricsError: Others could reach that address, or it is taken.
    """
    if not is_loopback(host):
        raise MetricsError(
            UserMessage(
                "metrics are for this machine alone: {host} is no address of its loopback",
                host=host,
            )
        )
    registry = CollectorRegistry()
    registry.register(_Collector(look))
    try:
        server, thread = start_http_server(port, host, registry)
    except OSError as error:
        reason = error.strerror or error
        raise MetricsError(
            UserMessage(
                "metrics cannot be offered at {host}:{port}: {reason}",
                host=host,
                port=port,
                reason=reason,
            )
        ) from None
    try:
        yield host, server.server_port
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class _Collector(Collector):
    """Makes metrics of the statuses at each scrape."""

    def __init__(self, look: Callable[[], Sequence[Status]]) -> None:
        self._read_statuses = look

    def describe(self) -> Iterable[Metric]:
        """Nothing: there are no names to clash with, and no status to be read at registration."""
        return ()

    def collect(self) -> Iterable[Metric]:
        """Return all metrics as they are now."""
        counters = {
            name: CounterMetricFamily(f"scaraspec_{name}", text, labels=("robot", "sender"))
            for name, text in (
                ("received_bytes", "Bytes received and forwarded."),
                ("recorded_bytes", "Bytes that are in the recording."),
                ("gap_bytes", "Bytes that are not, where their number is known."),
                ("gaps", "How often bytes are missing."),
            )
        }
        connections = CounterMetricFamily(
            "scaraspec_connections", "Connections.", labels=("robot",)
        )
        files = CounterMetricFamily("scaraspec_files", "Files made.", labels=("robot",))
        gauges = {
            name: GaugeMetricFamily(f"scaraspec_{name}", text, labels=("robot",))
            for name, text in (
                ("problems", "Problems of the writing so far."),
                ("waiting_bytes", "Bytes that wait to be written."),
                ("silent_seconds", "For how long nothing was written."),
                ("free_bytes", "Free bytes on the disk of the recording."),
            )
        }
        for status in self._read_statuses():
            robot, progress = [status.name], status.progress
            for sender, attribute in _WAYS:
                count = getattr(progress, attribute)
                for name, counter in counters.items():
                    counter.add_metric([status.name, sender], getattr(count, name))
            connections.add_metric(robot, progress.connections)
            files.add_metric(robot, progress.earlier_files + len(progress.files))
            for name, value in (
                ("problems", len(progress.problems)),
                ("waiting_bytes", status.waiting_bytes),
                ("silent_seconds", status.silent_s),
                ("free_bytes", status.free_bytes),
            ):
                gauges[name].add_metric(robot, value)
        return (*counters.values(), connections, files, *gauges.values())
