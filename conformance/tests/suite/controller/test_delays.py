"""A message that is delayed once fails no case, and a fault that appears rarely is found.

A proxy with simulated time delays one frame of a case, or of the probes, by up to 20 s. With
SCARASPEC_DELAYS every place is tried with every delay, and the mutants; `make trust` sets it.
"""

import os
import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple

import pytest

from scaraspec.judge.verdicts import Reason, Verdict
from scaraspec.mutants.controller import mutants
from scaraspec.mutants.controller_run import PASSWORD, Robot, hooks_of, tokens
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import TAG, Frame
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import Results
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run
from scaraspec.transports.link import Arrival, Ending, Link
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Session

DELAYS_S = (0.5, 1.0, 2.5, 4.0, 6.0, 11.0, 20.0)
ALL_DELAYS = "SCARASPEC_DELAYS" in os.environ
BEFORE = ""
"""Instead of the id of a case: the beginning of a run and its probes."""


class Place(NamedTuple):
    """Frames of a case. The one at this share of all of them is delayed."""

    case: str
    command: str = ""
    share: float = 0.0
    tagged: bool = False

    @property
    def head(self) -> bytes:
        """The first bytes of such a frame."""
        opcode = [BY_NAME[self.command].opcode] if self.command else []
        return bytes([C2A.start, *([TAG] if self.tagged else []), *opcode])


PLACES = {
    "login": Place("4.2/4", "login", 0.5),
    "query": Place("4.8/2", "get_status", 0.5),
    "positive-control": Place("4.14/2", "get_status"),
    "refusal": Place("4.15/2.missing", "run_program"),
    "run-accepted": Place("4.15/5", "run_program"),
    "run-ended": Place("4.15/5", "run_program", tagged=True),
    "move-accepted": Place("4.24/8.x", "set_tool_coordinates", 0.5),
    "move-ended": Place("4.24/8.x", "set_tool_coordinates", 0.5, tagged=True),
    "upload-name": Place("4.11/3", "upload_name", 0.5),
    "upload-chunk": Place("5.2/14.bytes", "upload_chunk", 0.5),
    "download-name": Place("5.3/3", "download_name", 0.5),
    "first-chunk": Place("5.3/4", "download_chunk"),
    "last-chunk": Place("5.3/4", "download_chunk", 1.0),
}
PROBES = [Place(BEFORE, share=share / 12) for share in range(0, 13, 1 if ALL_DELAYS else 6)]


@dataclass
class Proxy:
    """Delays one frame once. What follows it on its connection waits, too.

    Attributes:
        place: Which frames it counts.
        number: The number of the frame that it delays; None to count only.
        delay_s: The delay in seconds.
        count: How many frames it has counted.
        case: The running case.
        holding: The links on which something waits.
    """

    place: Place
    number: int | None = None
    delay_s: float = 0.0
    count: int = 0
    case: str = BEFORE
    holding: list[Any] = field(default_factory=list)

    def announce(self, case: Case) -> None:
        """Note which case runs."""
        self.case = case.id

    def delays(self, content: bytes | Ending) -> bool:
        """Count a frame, and return whether it is the one that is delayed."""
        counts = isinstance(content, bytes) and content.startswith(self.place.head)
        if self.case != self.place.case or not counts:
            return False
        self.count += 1
        return self.count - 1 == self.number


@dataclass(frozen=True)
class DelayingAccess(MemoryAccess):
    """The access to a controller through a proxy."""

    proxy: Proxy = field(kw_only=True)

    def connect(self) -> Link:
        """Open a connection through the proxy."""
        link = super().connect()
        receive, held = link.receive, list[tuple[float, bytes | Ending]]()

        def delayed(deadline_s: float, others: Sequence[Any] = (), /) -> Arrival | None:
            if not held:
                arrival = receive(deadline_s, [o for o in others if o not in self.proxy.holding])
                if arrival is None or not self.proxy.delays(arrival.content):
                    return arrival
                held.append((link.now_s + self.proxy.delay_s, arrival.content))
                self.proxy.holding.append(link)
            release_s, content = held[0]
            if (wait_s := min(deadline_s, release_s) - link.now_s) > 0:
                self.pause(wait_s)
            if link.now_s < release_s:
                return None
            held.clear()
            self.proxy.holding.remove(link)
            return Arrival(self.now_ns, content)

        link.receive = delayed  # type: ignore[method-assign] # the proxy
        return link


def run_through(
    proxy: Proxy,
    core: type[ControllerCore] = ControllerCore,
    only: Sequence[str] = (),
    cases: Sequence[str] = (),
) -> Results:
    """Run cases on a controller through a proxy."""
    robot = Robot(core, DEFAULT)
    options = Options(frozenset(only), ALL, undefined=True, examples=3, cases=frozenset(cases))
    access = DelayingAccess(robot.network, proxy=proxy)
    ics = Ics(hooks=hooks_of(robot))
    adapter = ControllerAdapter(access, ics, PASSWORD, options, draw_token=tokens().__next__)
    return Run(adapter, announce=proxy.announce).results()


@cache
def count_frames(
    place: Place, core: type[ControllerCore], only: Sequence[str], cases: Sequence[str]
) -> int:
    """Return how many frames of a place a run has without a delay."""
    proxy = Proxy(place)
    run_through(proxy, core, only, cases)
    assert proxy.count
    return proxy.count


def run_delayed(
    place: Place, delay_s: float, core: type[ControllerCore] = ControllerCore, *only: str
) -> Results:
    """Run the case of a place, or the cases of some requirements, with one delayed frame."""
    cases = () if only else (place.case or "4.14/2",)
    count = count_frames(place._replace(share=0.0), core, only, cases)  # type: ignore[arg-type] # a class has a hash
    proxy = Proxy(place, round(place.share * (count - 1)), delay_s)
    results = run_through(proxy, core, only, cases)
    assert proxy.count > (proxy.number or 0)
    return results


def failed(results: Results) -> list[str]:
    """Return the cases that failed."""
    wrong = (Verdict.FAIL, Verdict.ERROR)
    return [f"{case.id}: {case.message}" for case in results.cases if case.verdict in wrong]


def selected(count: int, delays: int) -> list[tuple[int, int]]:
    """Return all pairs of a place and a delay with `ALL_DELAYS`, else one for each place."""
    if ALL_DELAYS:
        return [(place, delay) for place in range(count) for delay in range(delays)]
    return [(place, (2 * place + 5) % delays) for place in range(count)]


@pytest.mark.parametrize(
    ("name", "delay_s"),
    [([*PLACES][place], DELAYS_S[d]) for place, d in selected(len(PLACES), len(DELAYS_S))],
)
def test_a_delay_fails_no_case(name: str, delay_s: float) -> None:
    """No case fails: it passes, or is inconclusive as intermittent."""
    assert failed(run_delayed(PLACES[name], delay_s)) == []


@pytest.mark.parametrize(
    ("place", "delay_s"),
    [(PROBES[place], DELAYS_S[d]) for place, d in selected(len(PROBES), len(DELAYS_S))],
)
def test_a_delay_in_the_probes_fails_no_case(place: Place, delay_s: float) -> None:
    """A delay at the beginning of a run, or in its probes, fails no case."""
    assert failed(run_delayed(place, delay_s)) == []


def test_a_delay_in_a_case_that_is_not_repeated_is_inconclusive() -> None:
    """The case waits for the late message, which proves nothing when it comes."""
    (case,) = (c for c in run_delayed(PLACES["login"], 20.0).cases if c.id == "4.2/4")
    assert case.reason is Reason.INTERMITTENT


def mutant_of_each_clause(count: int) -> list[str]:
    """Return one mutant for each of the first clauses."""
    by_clause: dict[str, str] = {}
    for mutant in mutants().values():
        clause = mutant.requirements[0].partition("/")[0]
        if not (mutant.reading or mutant.subtle):
            by_clause.setdefault(clause, mutant.name)
    return [*by_clause.values()][:count]


@pytest.mark.parametrize("name", mutant_of_each_clause(20 if ALL_DELAYS else 2))
def test_a_delay_hides_no_mutant(name: str) -> None:
    """A faulty controller fails a requirement that it violates, whichever frame is delayed."""
    mutant = mutants()[name]
    for number, delay_s in enumerate(DELAYS_S if ALL_DELAYS else DELAYS_S[-1:]):
        place = Place(BEFORE, share=number / len(DELAYS_S))
        results = run_delayed(place, delay_s, mutant.wrong, *mutant.requirements)
        violated = {c.requirements[0] for c in results.cases if c.verdict is Verdict.FAIL}
        assert violated & {*mutant.requirements}


def wrong_once_in_twenty(seed: int, *, silent: bool) -> type[ControllerCore]:
    """Return a controller whose frames are wrong, or are not sent, once in twenty times."""
    drawn = random.Random(seed)

    class Unreliable(ControllerCore):
        def emit(self, session: Session, frame: Frame) -> None:
            wrong = not drawn.randrange(20)
            if not (wrong and silent):
                super().emit(session, frame._replace(data=b"?") if wrong else frame)

    return Unreliable


@pytest.mark.parametrize("seed", range(20))
def test_a_rare_fault_is_never_conformant(seed: int) -> None:
    """A controller that answers wrongly, or not, once in twenty times passes no run."""
    core = wrong_once_in_twenty(seed, silent=seed % 2 == 1)
    results = run_through(Proxy(Place(BEFORE)), core, cases=("4.8/2",))
    assert not results.verdict.good
