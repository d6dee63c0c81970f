"""Hooks: commands of the user that operate the subject, for example restart it or set its inputs.

The ICS names them. They run without a shell and with a timeout.
"""

import shutil
import string
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Protocol

from scaraspec.operating_system import split_command
from scaraspec.user_message import UserMessage

HOOKS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "start": "starts the subject",
        "stop": "stops the subject",
        "restart": "stops the subject and starts it again, as after 0x05 or a crash",
        "power_cut": "switches the power of the subject off and on",
        "set_input": "sets digital input {port} to {value}, 0 or 1",
        "set_analog": "sets analog input {port} to {value}",
        "motor_fault": "causes a motor fault of {joints}, names of L299 separated by commas",
        "position_fault": "causes the position fault of code 05",
        "angle_fault": "causes the angle fault of code 06",
        "clear_faults": "removes every fault and its cause",
        "disk_full": "fills the disk of the subject",
        "disk_free": "frees the disk of the subject",
        "factory_reset": "sets the password of --password without a login; deletes no file",
    }
)
"""Every hook: its name in ``[hooks]``, what its command must do, and its placeholders."""

REQUESTS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "start": "switch the robot on, and wait until it has started",
        "restart": "switch the robot off at its plug and on again, and wait until it has started",
        "set_input": "set digital input {port} to {value}",
        "motor_fault": "cause a motor fault of {joints} that lasts",
        "position_fault": "cause the position fault of code 05 so that it lasts",
        "angle_fault": "cause the angle fault of code 06 so that it lasts",
        "clear_faults": "remove every fault and its cause",
    }
)
"""What an operator is asked to do in place of a hook, with the same placeholders.

The others need a program: `factory_reset`, because the suite risks the password if it can be reset,
and `set_analog`, because an operator cannot set an exact value.
"""

_SAMPLES: Final[Mapping[str, object]] = {"port": 1, "value": 1, "joints": "inner_arm"}
"""A value of each placeholder, to check a command line."""
_MAX_OUTPUT: Final = 200


def missing_hooks_message(names: Iterable[str]) -> UserMessage:
    """Return why a case does not run that needs hooks which the ICS does not define."""
    return UserMessage("it needs {hooks} in [hooks] of the ICS", hooks=", ".join(names))


class HookError(Exception):
    """A hook failed; the message is one sentence."""


class Hook(Protocol):
    """An operation on the subject."""

    def run(self, **values: object) -> None:
        """Run the hook.

        Raises:
            HookError: The hook failed.
        """


@dataclass(frozen=True, slots=True)
class CommandHook:
    """A command line with ``{placeholders}``, and its timeout in seconds."""

    name: str
    command: str
    timeout_s: float

    def check(self) -> None:
        """Check that the command can be started; nothing is started.

        Raises:
            HookError: The command is not valid, or its program is not there or not executable.
        """
        fields = [field for _, field, *_ in string.Formatter().parse(HOOKS[self.name]) if field]
        words = self._words({field: _SAMPLES[field] for field in fields})
        if not words:
            raise HookError(UserMessage("the hook {name} is empty", name=self.name))
        if shutil.which(words[0]) is None:
            raise HookError(
                UserMessage(
                    "the program {program} of the hook {name} does not exist or is not executable",
                    program=words[0],
                    name=self.name,
                )
            )

    def run(self, **values: object) -> None:
        """Run the command.

        Raises:
            HookError: The command cannot be started, does not end in time, or ends with a status
                other than 0.
        """
        words = self._words(values)
        try:
            done = subprocess.run(  # noqa: S603 - the user's command, without a shell
                words,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=self.timeout_s,
                check=False,
                stdin=subprocess.DEVNULL,
            )
        except subprocess.TimeoutExpired:
            raise HookError(
                UserMessage(
                    "the hook {name} did not end within {timeout_s:g} s",
                    name=self.name,
                    timeout_s=self.timeout_s,
                )
            ) from None
        except (OSError, ValueError) as error:
            raise HookError(
                UserMessage(
                    "the hook {name} cannot be started: {reason}",
                    name=self.name,
                    reason=getattr(error, "strerror", None) or error,
                )
            ) from None
        if done.returncode:
            output = (done.stderr or done.stdout).strip().splitlines()
            detail = f": {output[-1][:_MAX_OUTPUT]}" if output else ""
            raise HookError(
                UserMessage(
                    "the hook {name} ended with status {status}{detail}",
                    name=self.name,
                    status=done.returncode,
                    detail=detail,
                )
            )

    def _words(self, values: Mapping[str, object]) -> list[str]:
        """Return the words of the command line with these values.

        Raises:
            HookError: The command line is not valid, or has another placeholder.
        """
        try:
            return [word.format(**values) for word in split_command(self.command)]
        except (LookupError, AttributeError, ValueError) as error:
            raise HookError(
                UserMessage(
                    "the hook {name} is not a valid command line: {error}; its placeholders are: "
                    "{placeholders}",
                    name=self.name,
                    error=error,
                    placeholders=", ".join(values) or "none",
                )
            ) from None
