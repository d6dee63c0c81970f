"""The behaviour of the robot for each command of clauses 4 and 5, one method per command.

A method has the name of its command. It gets the request, acts, and returns the value of the first
reply, or `SILENCE`. `Base.send_after_reply` sends further frames after the first reply. The core
handles bytes, logins and the order of requests.
"""

from scaraspec.virtual_controller.behaviour.base import SILENCE, Silence
from scaraspec.virtual_controller.behaviour.motions import Motions
from scaraspec.virtual_controller.behaviour.ports import Ports
from scaraspec.virtual_controller.behaviour.programs import Programs
from scaraspec.virtual_controller.behaviour.settings import Settings
from scaraspec.virtual_controller.behaviour.transfers import Transfers

__all__ = ["SILENCE", "Behaviour", "Silence"]


class Behaviour(Settings, Programs, Motions, Ports, Transfers):
    """The behaviour of all commands."""
