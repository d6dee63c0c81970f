"""The worst that a command can do to a real robot; what a run permits is decided elsewhere.

The four hazards are kinds, not degrees: a run that allows motion has not thereby allowed a change
of state. Whoever permits a hazard names it.
"""

from enum import Enum


class Hazard(Enum):
    """The worst effect of one command or one test case on a real robot."""

    READ_ONLY = "read-only"
    """Nothing outlives the reply: the robot is asked, not told."""
    STATE = "state"
    """Session, clock, settings or stored files change; nothing moves."""
    MOTION = "motion"
    """The arm, its brakes or its outputs can move."""
    DESTRUCTIVE = "destructive"
    """Something is lost or access is cut: deletion, password, network, shutdown."""
