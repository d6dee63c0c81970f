"""Prometheus metrics of recordings, computed at each scrape and served only on the loopback."""

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
    """Metrics cannot be served at this address. The message is one sentence for the user."""


@contextmanager
def serve(host: str, port: int, look: Callable[[], Sequence[Status]]) -> Iterator[tuple[str, int]]:
    """Serve metrics while the context is active. Yields host and port.

    Args:
        host: A loopback address.
        port: The port; for 0, the system chooses one.
        look: Returns the status of all recordings; called in a separate thread.

    Raises:
        MetricsError: The address is not on the loopback, or is in use.
    """
    if not is_loopback(host):
        raise MetricsError(
            UserMessage(
                "metrics are served only on this machine: {host} is not a loopback address",
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
                "metrics cannot be served at {host}:{port}: {reason}",
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
    """Creates metrics from the statuses at each scrape."""

    def __init__(self, look: Callable[[], Sequence[Status]]) -> None:
        self._read_statuses = look

    def describe(self) -> Iterable[Metric]:
        """Return no metrics, so that registration reads no status."""
        return ()

    def collect(self) -> Iterable[Metric]:
        """Return the current metrics."""
        counters = {
            name: CounterMetricFamily(f"scaraspec_{name}", text, labels=("robot", "sender"))
            for name, text in (
                ("received_bytes", "Bytes received and forwarded."),
                ("recorded_bytes", "Bytes that are in the recording."),
                ("gap_bytes", "Bytes that are missing in the recording, if their number is known."),
                ("gaps", "Number of gaps in the recording."),
            )
        }
        connections = CounterMetricFamily(
            "scaraspec_connections", "Connections.", labels=("robot",)
        )
        unforwarded = CounterMetricFamily(
            "scaraspec_unforwarded_bytes",
            "Bytes received and not forwarded: urgent data, or the robot was not connected.",
            labels=("robot", "sender"),
        )
        files = CounterMetricFamily("scaraspec_files", "Files created.", labels=("robot",))
        gauges = {
            name: GaugeMetricFamily(f"scaraspec_{name}", text, labels=("robot",))
            for name, text in (
                ("problems", "Disabled sinks so far."),
                ("waiting_bytes", "Unwritten bytes in the spool."),
                ("silent_seconds", "Seconds since the last write."),
                ("free_bytes", "Free bytes on the disk of the recording."),
                ("archive_waiting_files", "Finished files that are not archived yet."),
                ("archive_waiting_bytes", "Their bytes."),
            )
        }
        for status in self._read_statuses():
            robot, progress = [status.name], status.progress
            for sender, attribute in _WAYS:
                count = getattr(progress, attribute)
                for name, counter in counters.items():
                    counter.add_metric([status.name, sender], getattr(count, name))
                dropped_bytes = sum(count.unforwarded_bytes.values())
                unforwarded.add_metric([status.name, sender], dropped_bytes)
            connections.add_metric(robot, progress.connections)
            files.add_metric(robot, progress.earlier_files + len(progress.files))
            for name, value in (
                ("problems", len(progress.problems)),
                ("waiting_bytes", status.waiting_bytes),
                ("silent_seconds", status.silent_s),
                ("free_bytes", status.free_bytes),
            ):
                gauges[name].add_metric(robot, value)
            if uploads := status.uploads:
                gauges["archive_waiting_files"].add_metric(robot, uploads.waiting)
                gauges["archive_waiting_bytes"].add_metric(robot, uploads.waiting_bytes)
        return (*counters.values(), unforwarded, connections, files, *gauges.values())
