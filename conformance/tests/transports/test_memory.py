"""Memory links: a machine in the same process, on a simulated clock."""

from dataclasses import dataclass, field

import pytest

from scaraspec.transports.link import Ending, LinkError
from scaraspec.transports.memory import MemoryNetwork


@dataclass
class _Act:
    connection: int
    data: bytes | None


@dataclass
class _Echo:
    """Echoes bytes after 1 s, sends "bye" and closes after 10 s; refuses serial connections."""

    due: list[tuple[float, _Act]] = field(default_factory=list)
    calls: list[str] = field(default_factory=list)

    @property
    def next_event_s(self) -> float | None:
        return min((time_s for time_s, _ in self.due), default=None)

    def open(self, connection: int, now_s: float, link: str) -> list[_Act]:
        if link == "serial":
            return [_Act(connection, None)]
        self.due += [(now_s + 10, _Act(connection, b"bye")), (now_s + 10, _Act(connection, None))]
        return []

    def receive(self, connection: int, data: bytes, now_s: float) -> list[_Act]:
        self.due.append((now_s + 1, _Act(connection, data)))
        return []

    def close(self, connection: int, now_s: float) -> list[_Act]:
        self.calls.append(f"{connection} closed at {now_s:g}")
        return []

    def advance(self, now_s: float) -> list[_Act]:
        done = [act for time_s, act in self.due if time_s <= now_s]
        self.due = [(time_s, act) for time_s, act in self.due if time_s > now_s]
        return done


def test_wait_advances_the_clock_to_the_next_event() -> None:
    """The clock stops at each event, and at the deadline if there is no event."""
    network = MemoryNetwork(_Echo(), now_s=5.0, epoch_ns=10**18)
    link = network.connect()
    assert link.send(b"a") == 10**18 + 5 * 10**9
    assert link.receive(5.5) is None
    assert link.now_s == 5.5
    assert link.receive(100.0) == (10**18 + 6 * 10**9, b"a")
    assert link.now_s == 6.0


def test_end_is_received_after_the_last_bytes() -> None:
    """After the last bytes, every `receive` returns the end, and `send` fails."""
    link = MemoryNetwork(_Echo()).connect()
    contents = [arrival.content for _ in range(3) if (arrival := link.receive(100.0))]
    assert contents == [b"bye", Ending.CLOSED, Ending.CLOSED]
    assert link.now_s == 10.0
    with pytest.raises(LinkError, match="the peer has ended the connection"):
        link.send(b"x")


def test_data_on_another_link_ends_the_wait() -> None:
    """The wait ends at the time of the data, which stays on the other link."""
    network = MemoryNetwork(_Echo())
    link, other = network.connect(), network.connect()
    other.send(b"a")
    assert link.receive(5.0, [other]) is None
    assert link.now_s == 1.0
    assert other.receive(0.0) == (10**9, b"a")
    assert link.receive(5.0, [other]) is None
    assert link.now_s == 5.0


def test_refused_link() -> None:
    """A refused link has ended immediately."""
    arrival = MemoryNetwork(_Echo()).connect("serial").receive(0.0)
    assert arrival is not None
    assert arrival.content is Ending.CLOSED


class _Line(_Echo):
    def open(self, connection: int, now_s: float, link: str) -> list[_Act]:
        self.calls.append(f"{connection} opened at {now_s:g} over {link}")
        return []


def test_serial_line_is_one_connection() -> None:
    """The machine does not notice a reopened line; data for a closed line is lost."""
    machine = _Line()
    network = MemoryNetwork(machine)
    with pytest.raises(LinkError, match="cannot be half closed"):
        network.connect("serial").half_close()
    for wait_s in (2.0, 0.0):
        link = network.connect("serial")
        link.send(b"?")
        link.close()
        network.run_until(network.now_s + wait_s)
    arrival = network.connect("serial").receive(100.0)
    assert arrival is not None
    assert arrival.content == b"?"
    assert network.now_s == 3.0
    assert machine.calls == ["1 opened at 0 over serial"]


def test_links_share_the_machine_and_its_clock() -> None:
    """A wait on one link processes the events of all links; each receives its own data."""
    network = MemoryNetwork(_Echo())
    first, second = network.connect(), network.connect()
    first.send(b"a")
    second.send(b"b")
    assert second.receive(2.0) == (10**9, b"b")
    assert first.now_s == 1.0
    assert first.receive(1.0) == (10**9, b"a")


@pytest.mark.parametrize("end", ["close", "reset", "half_close"])
def test_machine_receives_one_close(end: str) -> None:
    """After the end, `send` fails; only a half-closed link still receives."""
    machine = _Echo()
    network = MemoryNetwork(machine)
    link = network.connect()
    link.send(b"a")
    network.run_until(3.0)
    getattr(link, end)()
    getattr(link, end)()
    assert machine.calls == ["1 closed at 3"]
    with pytest.raises(LinkError, match="has been closed"):
        link.send(b"x")
    if end == "half_close":
        contents = [arrival.content for _ in range(2) if (arrival := link.receive(20.0))]
        assert contents == [b"a", Ending.CLOSED]
    else:
        with pytest.raises(LinkError, match="has been closed"):
            link.receive(20.0)


def test_event_that_stays_does_not_stop_the_clock() -> None:
    """The clock advances past an event that the machine does not remove."""

    class Stuck(_Echo):
        @property
        def next_event_s(self) -> float | None:
            return 1.0

    link = MemoryNetwork(Stuck()).connect()
    assert link.receive(2.0) is None
    assert link.now_s == 2.0
