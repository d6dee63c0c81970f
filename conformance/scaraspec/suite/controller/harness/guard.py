"""Guard: checks every frame that the suite sends to a controller, before it is sent.

The guard writes what the frame may change to the journal first. It rejects a frame that names a
file of the user. It also rejects a frame that can start a motion if the emergency stop does not
work.
"""

from collections import defaultdict, deque
from typing import Final

from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import Acceptance, NameListPart
from scaraspec.suite.controller.harness.emergency_stop import StopMonitor
from scaraspec.suite.controller.harness.other_clients import OtherClients
from scaraspec.suite.controller.harness.own_files import OwnFiles
from scaraspec.suite.controller.harness.suite_passwords import settable_passwords
from scaraspec.suite.engine.journal import Journal
from scaraspec.traffic.events import FrameSeen

SETTINGS: Final = {
    "set_time": "clock",
    "set_default_program": "default program",
    "set_gripper_center": "gripper centre",
    "set_initial_tool_position": "initial tool position",
    "set_digital_output": "outputs",
    "set_network": "network",
}
"""The setting that each command changes; the names are those of `state.restore.ITEMS`."""

EVERYTHING: Final = "*"
"""In the journal: any setting may have changed."""

_NAMES_A_FILE: Final = ("upload_name", "delete_program", "run_program", "simulate_program")
_SUITES: Final = settable_passwords(factory_reset=True)
_ANSWERED: Final = ("upload_name", "delete_program", "set_password", *SETTINGS)
_BAR: Final = b"|"
_NS: Final = 1e9


class Guard:
    """Checks and records the frames on all connections of a run.

    Args:
        journal: Records what the run may have changed.
        files: The files that the suite has created.
        password: The user's password; it is never written to the journal.
        reply_s: The reply timeout in seconds.
        others: Follows the settings to detect other clients.

    Attributes:
        stop: Checks whether the emergency stop works.
    """

    def __init__(
        self,
        journal: Journal,
        files: OwnFiles,
        password: bytes,
        reply_s: float,
        others: OtherClients,
    ) -> None:
        self._journal, self._files, self._others = journal, files, others
        self._password, self._reply_ns = password, reply_s * _NS
        self._pending: defaultdict[tuple[str, int], deque[FrameSeen]] = defaultdict(deque)
        self.stop = StopMonitor()

    # ------------------------------------------------------------------ requests

    def check(self, frame: Frame) -> None:
        """Check a frame before it is sent.

        Raises:
            CaseSkipped: The frame names a file of the user.
            StopFailed: The frame can start a motion, and the emergency stop does not work.
            JournalError: The change cannot be written to the journal.
        """
        command = BY_OPCODE.get(frame.opcode)
        if frame.direction is not A2C:
            return
        self.stop.before(frame)
        if command is None:
            self._before_motion()
            self.note_change(EVERYTHING)
            return
        if command.name in _NAMES_A_FILE:
            self._files.check(frame.data)
        if command.name == "upload_name":
            self._files.note_upload_request(frame.data)
        elif command.name == "set_password":
            self._before_password(frame.data)
        elif command.name in SETTINGS:
            self.note_change(SETTINGS[command.name])
        elif command.hazard is Hazard.MOTION and command.name != "emergency_stop":
            self._before_motion()

    def note_change(self, setting: str) -> None:
        """Record that a setting may change next.

        Raises:
            JournalError: This cannot be written to the journal.
        """
        if setting not in self._journal.changes.changed:
            self._journal.write("changing", setting=setting)

    def _before_motion(self) -> None:
        if not self._journal.changes.motion:
            self._journal.write("motion")
        self.note_change("outputs")  # a program or a reset may switch them

    def _before_password(self, data: bytes) -> None:
        _, _, new = data.partition(_BAR)
        self._journal.write("password", value=self._named(new))

    def _named(self, password: bytes) -> str | None:
        """Return the password as text for the journal; None if it contains the user's password."""
        contains = bool(self._password) and self._password in password
        if password == self._password or (contains and password not in _SUITES):
            return None
        return password.decode("latin-1")

    # ------------------------------------------------------------------ replies

    def sent(self, connection: str, seen: FrameSeen) -> None:
        """Record a frame that was sent."""
        self.stop.sent(connection, seen)
        self._others.sent(seen)
        command = BY_OPCODE.get(seen.frame.opcode)
        if command is None or command.name not in _ANSWERED:
            return
        pending = self._pending[connection, seen.frame.opcode]
        while pending and seen.place.time_ns - pending[0].place.time_ns > self._reply_ns:
            pending.popleft()  # it was never answered
        pending.append(seen)

    def received(self, connection: str, seen: FrameSeen) -> None:
        """Record a frame that the controller sent."""
        self.stop.received(connection, seen)
        command = BY_OPCODE.get(seen.frame.opcode)
        if command is None or seen.frame.tagged:
            return
        if isinstance(seen.value, NameListPart):
            self._files.note_list(seen.value.names)
        self._others.received(connection, seen)
        pending = self._pending.get((connection, seen.frame.opcode))
        if not pending:
            return
        request, accepted = pending.popleft(), _accepts(seen)
        data = request.frame.data
        self._others.answered(request, accepted=accepted)
        if command.name == "upload_name":
            self._files.note_upload_reply(data, accepted=accepted)
        elif command.name == "delete_program" and accepted:
            self._files.note_deleted(data)
        elif command.name == "set_password" and not accepted:
            self._journal.confirm("password-refused", value=self._named(data.partition(_BAR)[2]))


def _accepts(seen: FrameSeen) -> bool:
    """Whether a first reply accepts the request."""
    value = seen.value
    return value.accepted if isinstance(value, Acceptance) else value is True
