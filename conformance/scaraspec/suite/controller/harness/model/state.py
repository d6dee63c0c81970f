"""The state of a model: the expected state of the controller after all requests so far."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import TYPE_CHECKING, Final, NamedTuple

from scaraspec.protocol.commands import Pose
from scaraspec.protocol.payloads import JogDirection
from scaraspec.suite.controller.harness.controller_under_test import (
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    is_responsive,
    pose_of,
)
from scaraspec.suite.controller.harness.requests.ports import (
    Bits,
    outputs,
    set_output,
    settable_outputs,
    with_port,
)
from scaraspec.suite.controller.harness.two_stage.commands import (
    RUN,
    SIMULATE,
    STOP,
)
from scaraspec.suite.engine.expectations import NoReply

if TYPE_CHECKING:
    from scaraspec.suite.controller.harness.requests.clock import (
        ClockSample,
    )

VALUES: Final = 4
"""How many values each number of a step can have."""

SEEDS: Final = 2**16
"""How many values the seed of a step can have."""

_WHOLE, _CUT = 9, 7
"""Of so many steps, the first ones send each request as a whole, and the others in segments."""
_SEGMENT_BYTES: Final = (1, 1, 1, 2, 3, 8, 30, 100)
"""Sizes of segments that end in the header or in the data of a request."""
_SEGMENTS: Final = 4

READING: Final = (
    *("look", "query", "list_programs", "get_default", "get_poses", "get_place", "get_outputs"),
    "get_clock",
)
"""Steps that change nothing and compare a state with the model."""

_LINES: Final = 2

ENDLESS: Final = 2  # from this value on, a program does not end

IDLE_STOP: Final = "stop nothing"

SWITCHED_OFF_BY: Final = [
    frozenset(chosen)
    for count in range(5)
    for chosen in itertools.combinations((RUN, SIMULATE, STOP, IDLE_STOP), count)
]
"""The sets of events at which a controller may switch all outputs off (A-4.32-3)."""


Writes = Mapping[int, bool]
"""The outputs that a program sets, by port."""


class Step(NamedTuple):
    """One step. A step may ignore some of its numbers.

    Attributes:
        act: The name of the step; `Model` has a method for each.
        which: Selects a file or a port.
        value: Selects the value to set.
        line: Selects the connection.
        seed: Selects what has many values: numbers, times, contents, and how requests are cut.
        turn: How many steps of this name precede it in the case. It selects what every run must
            try: each axis in each direction, each name, each kind of time.
        slow: Whether one of its requests is sent with a long pause between two segments.
    """

    act: str
    which: int
    value: int
    line: int
    seed: int = 0
    turn: int = 0
    slow: bool = False

    @property
    def random(self) -> Random:
        """A source of values that depends only on the step."""
        return Random(f"{self}")  # noqa: S311 - it must be reproducible

    @property
    def cuts(self) -> Sequence[int]:
        """The sizes of the segments of its requests in bytes; for most steps there is one."""
        if self.seed % (_WHOLE + _CUT) < _WHOLE:
            return ()
        random = self.random
        return random.choices(_SEGMENT_BYTES, k=random.randint(1, _SEGMENTS))


@dataclass
class Scene:
    """What the sequences of a case have in common.

    Attributes:
        names: The names of the files that may be created.
        home: The pose at the start, for a gripper center of zero; None if the arm must not move.
        place: The pose after the last move; None if it is unknown.
        jogged: The directions in which a jog has moved the arm.
    """

    names: Sequence[bytes]
    home: Pose | None = None
    place: Pose | None = field(init=False)
    jogged: set[JogDirection] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.place = self.home


class ModelState:
    """The expected state of the controller, and the connections to it.

    Args:
        subject: The controller.
        acts: The names of the steps that may occur.
        scene: What may be created, and where the arm may move.

    Attributes:
        history: The steps so far, in words.
    """

    def __init__(self, subject: ControllerUnderTest, acts: list[str], scene: Scene) -> None:
        self.history: list[str] = []
        self._subject, self._acts = subject, acts
        self._scene, self._names = scene, scene.names
        self._password = subject.password
        self._lines = [self._connection()]
        if subject.supports_multiple_connections:
            self._lines += [self._connection() for _ in range(_LINES - 1)]
        self._constant: dict[str, bytes] = {}
        self._files: dict[bytes, bytes] = {}
        self._writes: dict[bytes, Writes] = {}  # what the programs that end do to the outputs
        self._deleted: bytes | None = None  # a default program, whose name is used again next
        self._endless_programs: list[bytes] = []
        self._downloading_line: OutgoingConnection | None = None
        self._default: bytes | None = None
        self._accepted_default: bytes | None = (
            None  # the last accepted default program, stored or not
        )
        self._centers: list[tuple[float, ...]] = []  # the possible values; empty if unknown
        self._initials: list[tuple[float, ...]] = []
        self._clock: ClockSample | None = None
        self._running: tuple[str, bytes, OutgoingConnection] | None = None
        self._started_s = 0.0  # when the last program was requested
        if "set_initial" in acts:
            self._here = scene.home or pose_of(self._lines[0])
        self._outputs: dict[frozenset[str], Bits] = {}  # by the events that switch all outputs off
        self._ports: list[int] = []
        if "set_output" in acts:
            self._ports = settable_outputs(self._lines[0])
            self._before = on = outputs(self._lines[0])
            if set_output(self._lines[0], self._ports[-1], on=True).accepted:
                on = with_port(on, self._ports[-1], on=True)  # all off is another state then
            self._outputs = dict.fromkeys(SWITCHED_OFF_BY, on)

    def _connection(self) -> OutgoingConnection:
        return self._subject.open(password=self._password)

    def _name(self, step: Step) -> bytes:
        """Return the name of a stored file; for the last number a name that may not be stored."""
        if self._files and step.which < VALUES - 1:
            return list(self._files)[step.which % len(self._files)]
        return self._names[(step.value + step.seed) % len(self._names)]

    @property
    def _unresponsive(self) -> bool:
        """Whether a command executes and the robot answers no query until it ends (A-4-3)."""
        return self._running is not None and not is_responsive(self._subject, self._running[2])

    def _simulation_ended(self, *, within_s: float) -> bool:
        """Whether the executing simulation has ended by itself, which may happen at any time."""
        if not self._running or self._running[0] != SIMULATE:
            return False
        try:
            self._running[2].result(SIMULATE, within_s=within_s)
        except NoReply:
            return False
        self._running = None
        return True
