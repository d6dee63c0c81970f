"""Traits: what a run has detected about the controller under test, besides its readings.

Most traits are tried once per run. None means that a trait has not been tried yet.
"""

from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import NamedTuple

from scaraspec.protocol.commands import Pose
from scaraspec.protocol.program_files import Layout, Program


class PointMeaning(StrEnum):
    """The meaning of the four values of a point: the options of the reading `point_meaning`."""

    JOINTS = "joints"
    POSE = "pose"


class LayoutTrial(NamedTuple):
    """When a program was requested, accepted and finished, in seconds since the Unix epoch."""

    requested_s: float
    replied_s: float
    ended_s: float


@dataclass
class ControllerTraits:
    """What a run has detected about a controller, besides its readings.

    A comment above each group of fields names the module that sets it.

    Attributes:
        greeting_opcodes: The opcodes of the frames that it sends unsolicited on a new connection
            (A-3-16).
        closes_late: It refuses a client for a time after an earlier one has left (A-2-11).
        releases_late: This time is longer than a moment.
        displaces_first_client: It closes the first of several connections when another one opens.
        only_first_client_commands: It refuses the commands of all clients but the first (A-2-2).
        transfers_outlive_connection: A transfer whose connection has ended continues until its
            timeout (A-5-17).
        unresponsive_while_executing: It answers no query while a command executes (A-4-3).
        unresponsive_while_jogging: It answers no query while it jogs.
        jog_notation: The notation of a jog that it has accepted (A-4.28-1).
        may_be_latched: An emergency stop may have latched it (A-4.17-2); False once it is clear
            that a stop does not latch it.
        latches: An emergency stop has latched it in this run.
        wrong_passwords_tried: How many wrong passwords sequences have tried.
        stores_only_programs: It refuses a file that is not a valid program (A-5-21).
        stable_inputs: The digital inputs that did not change during a second.
        no_late_reply: The commands whose malformed request it left unanswered.
        start_poses: The reported poses before the arm was moved away from the end of its travel.
        point_meaning: What the values of a point are; None if no meaning fits.
        point_meaning_tried: `point_meaning` was determined, or its trial has failed.
        program_layout: The layout in which it runs programs; None if it runs none.
        program_layout_tried: `program_layout` was determined, or every layout has failed.
        layout_trial: The run of the program with which the layout was determined.
        listed_layout: A layout of which a program is listed. Its byte order may differ from that
            of the chunks (A-6.1-4).
        configured_program: An empty program whose configuration equals that of the robot.
    """

    def copy(self) -> "ControllerTraits":
        """Return an independent copy."""
        return replace(self, no_late_reply=self.no_late_reply.copy())

    def with_history_of(self, later: "ControllerTraits") -> "ControllerTraits":
        """Return a copy of these traits with the events that `later` has recorded."""
        return replace(
            self,
            wrong_passwords_tried=later.wrong_passwords_tried,
            may_be_latched=later.may_be_latched,
            latches=later.latches,
            start_poses=later.start_poses,
        )

    # set by controller_under_test and places
    greeting_opcodes: frozenset[int] | None = None
    closes_late: bool = False
    releases_late: bool = False
    wrong_passwords_tried: int = 0

    # set by probes
    displaces_first_client: bool = False
    only_first_client_commands: bool = False
    transfers_outlive_connection: bool | None = None
    listed_layout: Layout | None = None

    # set by requests.motion; `may_be_latched` by controller_under_test, too
    unresponsive_while_executing: bool | None = None
    unresponsive_while_jogging: bool | None = None
    may_be_latched: bool | None = None
    latches: bool = False

    # set by requests.files
    stores_only_programs: bool | None = None

    # set by requests.ports
    stable_inputs: frozenset[int] | None = None

    # set by malformed.payloads
    no_late_reply: set[str] = field(default_factory=set)

    # set by state.readiness
    start_poses: tuple[Pose, ...] = ()

    # set by two_stage.tasks
    jog_notation: str | None = None

    # set by two_stage.arm
    point_meaning: PointMeaning | None = None
    point_meaning_tried: bool = False

    # set by program_files.layout
    program_layout: Layout | None = None
    program_layout_tried: bool = False
    layout_trial: LayoutTrial | None = None
    configured_program: Program | None = None
