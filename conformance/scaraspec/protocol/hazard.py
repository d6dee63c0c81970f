"""Hazard: the worst effect that a command can have on a real robot.

The four hazards are kinds and not degrees: a run that allows motion does not also allow a change of
state. The user allows each hazard by name. This module does not decide what a run allows.
"""

from enum import Enum


class Hazard(Enum):
    """The worst effect of one command or one test case on a real robot."""

    READ_ONLY = "read-only"
    """The command only queries the robot; nothing remains after the reply."""
    STATE = "state"
    """The session, clock, settings or stored files change; nothing moves."""
    MOTION = "motion"
    """The arm, its brakes or its outputs can move."""
    DESTRUCTIVE = "destructive"
    """Data or access may be lost: deletion, password, network settings, shutdown."""
