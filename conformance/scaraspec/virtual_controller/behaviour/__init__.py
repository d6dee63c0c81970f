"""Behaviour: what the robot does for each command of clauses 4 and 5, one method per row.

A method bears the name of its row. It takes the request, acts, and returns what the first reply
says, or `SILENCE`; what is to go out after that it hands to `Base.later`. Bytes, logins and the
order of requests are the core's.
"""

from scaraspec.virtual_controller.behaviour.base import SILENCE, Silence
from scaraspec.virtual_controller.behaviour.motions import Motions
from scaraspec.virtual_controller.behaviour.ports import Ports
from scaraspec.virtual_controller.behaviour.programs import Programs
from scaraspec.virtual_controller.behaviour.settings import Settings
from scaraspec.virtual_controller.behaviour.transfers import Transfers

__all__ = ["SILENCE", "Behaviour", "Silence"]


class Behaviour(Settings, Programs, Motions, Ports, Transfers):
    """Every command of the table."""
