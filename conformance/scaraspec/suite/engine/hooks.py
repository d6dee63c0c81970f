"""Hooks: commands of the tester's own that handle the subject: restart it, drive its inputs.

They come from the statement of conformance, run without a shell and within a time limit.
"""

import shlex
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Protocol

from scaraspec.user_message import UserMessage

HOOKS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "start": "starts the subject",
        "stop": "ends it in order",
        "restart": "ends it and starts it again, as after 0x05 or a crash",
        "power_cut": "cuts its power and gives it back",
        "set_input": "drives digital input {port} to {value}, 0 or 1",
        "set_analog": "drives analog input {port} to {value}",
        "motor_fault": "makes the motors fail of {joints}, names of L299 between commas",
        "position_fault": "makes the position fault of code 05",
        "angle_fault": "makes the angle fault of code 06",
        "clear_faults": "takes every fault and its cause away",
        "disk_full": "lets the subject's disk take no more",
        "disk_free": "gives the disk room again",
        "factory_reset": "sets the password of --password without a login; deletes no file",
    }
)
"""Every hook: its name in ``[hooks]``, and what its command has to do."""


class HookError(Exception):
    """A hook did not do its work; one sentence."""


class Hook(Protocol):
    """One way to handle the subject."""

    def run(self, **values: object) -> None:
        """Do it.

        Raises:
            HookError: It did not do its work.
        """


@dataclass(frozen=True, slots=True)
class CommandHook:
    """A command line with ``{placeholders}``, and how long it may take, in seconds."""

    name: str
    command: str
    timeout_s: float

    def run(self, **values: object) -> None:
        """Run it.

        Raises:
            HookError: It cannot be started, does not end in time, or ends with another status
                than 0.
        """
        try:
            words = [word.format(**values) for word in shlex.split(self.command)]
            done = subprocess.run(  # noqa: S603 - the tester's own command, without a shell
                words,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=self.timeout_s,
                check=False,
                stdin=subprocess.DEVNULL,
            )
        except (KeyError, IndexError, ValueError) as error:
            raise HookError(
                UserMessage(
                    "the hook {self_} is no command line: {error}", self_=self.name, error=error
                )
            ) from None
        except subprocess.TimeoutExpired:
            raise HookError(
                UserMessage(
                    "the hook {self_} did not end in {timeout_s:g} s",
                    self_=self.name,
                    timeout_s=self.timeout_s,
                )
            ) from None
        except OSError as error:
            raise HookError(
                UserMessage(
                    "the hook {self_} cannot be run: {strerror}",
                    self_=self.name,
                    strerror=error.strerror,
                )
            ) from None
        if done.returncode:
            said = (done.stderr or done.stdout).strip().splitlines()
            why = UserMessage(": {said}", said=said[-1][:200]) if said else ""
            raise HookError(
                UserMessage(
                    "the hook {self_} ended with status {returncode}{why}",
                    self_=self.name,
                    returncode=done.returncode,
                    why=why,
                )
            )
