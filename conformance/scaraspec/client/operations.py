"""Operations: one method for each row of the table, written once for both shells.

A method says what to ask of the core and how its caller is told; the shell that it is called on
carries that out, blocking in `Client`, awaited in `AsyncClient`. To add a row, add its method.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, TypeVar, overload

from scaraspec.client.core import ClientCore
from scaraspec.client.local_files import check_new, write_new
from scaraspec.client.pending_operation import PendingOperation, Progress
from scaraspec.client.results import RunningProgram, Status
from scaraspec.protocol.commands import (
    JointValues,
    MoveTarget,
    Network,
    PasswordChange,
    Point,
    PortValue,
    Pose,
)
from scaraspec.protocol.fields import Clock, Diagnostics, PayloadError
from scaraspec.protocol.payloads import JogDirection
from scaraspec.protocol.readings import Dialect
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from collections.abc import Coroutine

    from scaraspec.client.aio import AsyncClient, AsyncPending
    from scaraspec.client.blocking import Client, Pending

P = ParamSpec("P")
T = TypeVar("T")

_CLOCK = Clock("time")

Text = str | bytes
"""A name or a password. `str` goes out in the dialect's encoding, UTF-8 unless it says otherwise,
and comes back so; bytes that are none come back as surrogate escapes, and go out unharmed (T/8)."""


@dataclass(frozen=True, slots=True)
class Call(Generic[T]):
    """An operation with its arguments: what to ask of the core, and what to tell the caller."""

    prepare: Callable[[ClientCore], PendingOperation]
    convert: Callable[[Any], T]
    progress: Progress | None = None


class operation(Generic[P, T]):  # noqa: N801 - a decorator
    """Makes a method that describes a `Call` one that carries it out."""

    def __init__(self, describe: Callable[Concatenate[Any, P], Call[T]]) -> None:
        self.describe = describe
        self.__doc__ = describe.__doc__

    @overload
    def __get__(self, shell: None, owner: type) -> "operation[P, T]": ...
    @overload
    def __get__(self, shell: "Client", owner: type) -> Callable[P, T]: ...
    @overload
    def __get__(
        self, shell: "AsyncClient", owner: type
    ) -> "Callable[P, Coroutine[Any, Any, T]]": ...
    def __get__(self, shell: Any, owner: type) -> Any:
        """The method as it is bound to a shell."""
        if shell is None:
            return self
        return lambda *args, **kwargs: shell.perform(self.describe(shell, *args, **kwargs))


class start_method(Generic[P]):  # noqa: N801 - a decorator
    """The other form of a two-stage operation: it ends with the first reply.

    What it returns is waited for separately (`Pending`, `AsyncPending`); a refusal shows there.
    """

    def __init__(self, whole: operation[P, None]) -> None:
        self.describe = whole.describe
        self.__doc__ = whole.__doc__

    @overload
    def __get__(self, shell: None, owner: type) -> "start_method[P]": ...
    @overload
    def __get__(self, shell: "Client", owner: type) -> "Callable[P, Pending]": ...
    @overload
    def __get__(
        self, shell: "AsyncClient", owner: type
    ) -> "Callable[P, Coroutine[Any, Any, AsyncPending]]": ...
    def __get__(self, shell: Any, owner: type) -> Any:
        """The method as it is bound to a shell."""
        if shell is None:
            return self
        return lambda *args, **kwargs: shell.start(self.describe(shell, *args, **kwargs))


def _command_call(
    name: str, value: Any = None, convert: Callable[[Any], Any] = lambda value: value
) -> Call[Any]:
    """The call of a command of the table."""
    return Call(lambda core: core.command(name, value), convert)


class Operations(ABC):
    """What a client can do.

    Every method may raise:

    - `PayloadError`: the document forbids to send that; nothing was sent.
    - `LoginFailed`: the login failed, or there was none yet.
    - `Refused`, `Failed`, `Interrupted`: the controller did not do it; `.code` says why.
    - `ReplyTimeout`, `LinkLost`: it did not answer. Whether it did it is not known: ask
      `get_status` before anything else, after a new connection too (A-2-9).
    - `ProtocolError`: its answer makes no sense.

    Two-stage methods return when the final result is in, for which there is no bound (A-3-15);
    their ``start_`` forms return with the first reply.
    """

    @property
    @abstractmethod
    def dialect(self) -> Dialect:
        """The readings that are spoken."""

    # 4.1 - 4.8: session and settings

    @operation
    def login(self, password: Text) -> Call[None]:
        """Log in; nothing else is sent before that has succeeded (4.1, L104)."""
        return _command_call("login", self._bytes(password))

    @operation
    def set_password(self, old: Text, new: Text) -> Call[None]:
        """Replace the password (4.2, L123-125)."""
        return _command_call("set_password", PasswordChange(self._bytes(old), self._bytes(new)))

    @operation
    def get_network(self) -> Call[Network]:
        """The controller's address, mask and gateway (4.3, L145-153)."""
        return _command_call("get_network")

    @operation
    def set_network(self, ip: str, mask: str, gateway: str) -> Call[None]:
        """Set address, mask and gateway; the link may end after that (4.4, L157-162)."""
        return _command_call("set_network", Network(ip, mask, gateway))

    @operation
    def set_time(self, time: datetime | str) -> Call[None]:
        """Set the clock, to the second; a time zone is not sent (4.5, L169; A-4.5-1).

        Args:
            time: A time, or its text as YYYYMMDDHHMMSS.
        """
        return _command_call("set_time", time if isinstance(time, datetime) else _time(time))

    @operation
    def get_time(self) -> Call[datetime]:
        """The controller's clock, without a time zone (4.6, L181-189)."""
        return _command_call("get_time")

    @operation
    def get_version(self) -> Call[str]:
        """The version of the controller's software (4.7, L193-203)."""
        return _command_call("get_version")

    @operation
    def get_status(self) -> Call[Status]:
        """Whether the robot is idle, running or in error, and why (4.8, L207-217)."""
        return _command_call("get_status", convert=Status.of)

    # 4.9 - 4.16: programs

    @operation
    def get_running_program(self) -> Call[RunningProgram | None]:
        """The program that runs and since when; None if none runs (4.9, L221-237)."""
        return _command_call(
            "get_running_program",
            convert=lambda run: run and RunningProgram(self._text(run.name), run.run_time_s),
        )

    @operation
    def list_programs(self) -> Call[tuple[str, ...]]:
        """The names of all programs, in the controller's order (4.10, L241-251)."""
        return _command_call("list_programs", convert=lambda names: tuple(map(self._text, names)))

    @operation
    def delete_program(self, name: Text) -> Call[None]:
        """Delete a program (4.11, L255-263)."""
        return _command_call("delete_program", self._bytes(name))

    @operation
    def get_default_program(self) -> Call[str | None]:
        """The default program's name; None if none is set (4.12, L267-275)."""
        return _command_call("get_default_program", convert=lambda name: self._text(name) or None)

    @operation
    def set_default_program(self, name: Text) -> Call[None]:
        """Set the default program, which may act at the next power-on (4.13; A-4.12-3)."""
        return _command_call("set_default_program", self._bytes(name))

    @operation
    def get_motor_temperatures(self) -> Call[JointValues]:
        """The temperatures of the four motors, in °C (4.14, L291-302)."""
        return _command_call("get_motor_temperatures")

    @operation
    def run_program(self, name: Text) -> Call[None]:
        """Run a program to its end (4.15, L306-328)."""
        return _command_call("run_program", self._bytes(name))

    start_run_program = start_method(run_program)

    @operation
    def simulate_program(self, name: Text) -> Call[None]:
        """Simulate a program to its end; the arm may move all the same (4.16; A-4.16-1)."""
        return _command_call("simulate_program", self._bytes(name))

    start_simulate_program = start_method(simulate_program)

    # 4.17 - 4.28: motion

    @operation
    def emergency_stop(self) -> Call[None]:
        """Stop the robot (4.17, L358-383); no substitute for a hardware emergency stop.

        May be called while other calls wait, from another thread or task. Where nothing has to
        be stopped the controller refuses it (L363).
        """
        return _command_call("emergency_stop")

    start_emergency_stop = start_method(emergency_stop)

    @operation
    def reset(self) -> Call[None]:
        """Reset the robot, which may move it (4.18, L387-419; A-4.18-3)."""
        return _command_call("reset")

    start_reset = start_method(reset)

    @operation
    def get_gripper_center(self) -> Call[Point]:
        """The gripper's working point relative to the tool, in mm (4.19, L423-431)."""
        return _command_call("get_gripper_center")

    @operation
    def set_gripper_center(self, x: float, y: float, z: float) -> Call[None]:
        """Set the gripper's working point relative to the tool, in mm (4.20, L435-443)."""
        return _command_call("set_gripper_center", Point(x, y, z))

    @operation
    def set_initial_tool_position(  # noqa: PLR0913, PLR0917 - the six fields of L447
        self, x: float, y: float, z: float, theta_x: float, theta_y: float, theta_z: float
    ) -> Call[None]:
        """Store the initial tool position, in mm and degrees (4.21, L447-455)."""
        return _command_call("set_initial_tool_position", Pose(x, y, z, theta_x, theta_y, theta_z))

    @operation
    def get_initial_tool_position(self) -> Call[Pose]:
        """The initial tool position; thetaY and thetaZ mean nothing (4.22, L459-467; L1006)."""
        return _command_call("get_initial_tool_position")

    @operation
    def get_tool_coordinates(self) -> Call[Pose]:
        """Where the tool is; thetaY and thetaZ mean nothing (4.23, L471-479; L1006)."""
        return _command_call("get_tool_coordinates")

    @operation
    def set_tool_coordinates(  # noqa: PLR0913, PLR0917 - the seven fields of L483
        self,
        speed: int,
        x: float,
        y: float,
        z: float,
        theta_x: float,
        theta_y: float,
        theta_z: float,
    ) -> Call[None]:
        """Move the tool there, in mm and degrees, at 1 to 100 % of full speed (4.24, L483-516)."""
        target = MoveTarget(speed, x, y, z, theta_x, theta_y, theta_z)
        return _command_call("set_tool_coordinates", target)

    start_set_tool_coordinates = start_method(set_tool_coordinates)

    @operation
    def release_joints(self) -> Call[None]:
        """Release all joints, so that they move freely; the wrist may fall (4.25, L520-549)."""
        return _command_call("release_joints")

    start_release_joints = start_method(release_joints)

    @operation
    def lock_joints(self) -> Call[None]:
        """Lock all joints (4.26, L553-582)."""
        return _command_call("lock_joints")

    start_lock_joints = start_method(lock_joints)

    @operation
    def get_joint_angles(self) -> Call[JointValues]:
        """The four joints in degrees, the wrist in mm (4.27, L586-594; A-4.27-3)."""
        return _command_call("get_joint_angles")

    @operation
    def jog(self, direction: JogDirection | str) -> Call[None]:
        """Move along ``+y``, ``-y``, ``+x`` or ``-x`` until stopped (4.28, L598-637).

        The document names no way to stop it; `emergency_stop` does (A-4.28-3).
        """
        return _command_call("jog", parse_direction(direction))

    start_jog = start_method(jog)

    # 4.31 - 4.35: inputs, outputs, power

    @operation
    def get_digital_inputs(self) -> Call[str]:
        """The digital inputs, a digit each, port 8 leftmost (4.31, L641-651)."""
        return _command_call("get_digital_inputs")

    @operation
    def set_digital_output(self, port: int, value: int) -> Call[None]:
        """Set a digital output to 0 or 1 (4.32, L655-663)."""
        return _command_call("set_digital_output", PortValue(port, value))

    @operation
    def get_analog_input(self, port: int) -> Call[float]:
        """The value of an analog input, on a scale that is not told (4.33, L667-675; A-4.33-1)."""
        return _command_call("get_analog_input", port)

    @operation
    def get_digital_outputs(self) -> Call[str]:
        """The digital outputs, a digit each, port 16 leftmost (4.34, L679-687)."""
        return _command_call("get_digital_outputs")

    @operation
    def shutdown(self) -> Call[None]:
        """Shut the robot down; the link may end after that (4.35, L691-706)."""
        return _command_call("shutdown")

    # 5: files

    @operation
    def upload(
        self,
        local: str | os.PathLike[str],
        remote: Text | None = None,
        progress: Progress | None = None,
    ) -> Call[None]:
        """Send a file to the controller (5.2, L743-763).

        Args:
            local: The file.
            remote: Its name on the controller; the local file's own if not given.
            progress: Called after each chunk; an exception from it aborts the upload.

        Raises:
            OSError: The file cannot be read; nothing was sent.
            TransferFailed: It did not arrive; what of it stays behind is open (A-5-12).
        """
        path = Path(local)
        return self._upload(path.name if remote is None else remote, path.read_bytes(), progress)

    @operation
    def upload_bytes(
        self, content: bytes, remote: Text, progress: Progress | None = None
    ) -> Call[None]:
        """Send `content` as a file to the controller; otherwise as `upload`."""
        return self._upload(remote, content, progress)

    @operation
    def download(
        self,
        remote: Text,
        local: str | os.PathLike[str] | None = None,
        progress: Progress | None = None,
    ) -> Call[Path]:
        """Fetch a file from the controller (5.3, L767-787).

        Args:
            remote: Its name on the controller.
            local: The file to make; one of the same name in the working directory if not given.
            progress: Called after each chunk; an exception from it aborts the download.

        Returns:
            The file that was made.

        Raises:
            OSError: The file exists or cannot be made; before the transfer where that shows.
            TransferFailed: It did not arrive; there is no file then.
        """
        name = self._bytes(remote)
        path = Path(self._text(name) if local is None else local)

        def write(content: bytes) -> Path:
            write_new(path, content)
            return path

        check_new(path)
        return Call(lambda core: core.download(name), write, progress)

    @operation
    def download_bytes(self, remote: Text, progress: Progress | None = None) -> Call[bytes]:
        """Fetch the content of a file from the controller; otherwise as `download`."""
        name = self._bytes(remote)
        return Call(lambda core: core.download(name), bytes, progress)

    def _upload(self, remote: Text, content: bytes, progress: Progress | None) -> Call[None]:
        name = self._bytes(remote)
        return Call(lambda core: core.upload(name, content), lambda nothing: nothing, progress)

    def _bytes(self, text: Text) -> bytes:
        if isinstance(text, bytes):
            return text
        try:
            return text.encode(self._encoding, "surrogateescape")
        except UnicodeEncodeError as error:
            raise PayloadError(
                UserMessage(
                    "{text!r} cannot be written in {encoding}", text=text, encoding=error.encoding
                )
            ) from None

    def _text(self, data: bytes) -> str:
        return data.decode(self._encoding, "surrogateescape")

    @property
    def _encoding(self) -> str:
        encoding = self.dialect["text_encoding"]
        return "utf-8" if encoding == "bytes" else encoding


def _time(text: str) -> datetime:
    """The time that a text of the protocol means.

    Raises:
        PayloadError: It means none.
    """
    time = _CLOCK.read(str(text).encode(), Diagnostics())
    if time is None:
        raise PayloadError(
            UserMessage("{text!r} is no time: it is written as YYYYMMDDHHMMSS (L172)", text=text)
        )
    return time


def parse_direction(direction: JogDirection | str) -> JogDirection:
    """The direction of a jog by its name, ``+y``, ``-y``, ``+x`` or ``-x`` (L605-608).

    Raises:
        PayloadError: There is no such direction.
    """
    for known in JogDirection:
        if direction in (known, str(known)):
            return known
    raise PayloadError(
        UserMessage(
            "direction {direction!r} is none of {jogdirection}",
            direction=direction,
            jogdirection=", ".join(map(str, JogDirection)),
        )
    )
