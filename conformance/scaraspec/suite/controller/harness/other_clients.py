"""Other clients: detects that another program has changed a setting, the clock or a file.

The suite follows every request and reply of the run. A faulty controller reports deviating values,
too, so a deviation alone is no proof. After a failure, another client is the cause if the setting
changes while the suite sends only queries (`state.watch`), or if the deviation is suspicious
(`followed_setting`) and the case passes when it is repeated. Every deviation of the outputs is
suspicious: their cases set them so often that a fault recurs.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from scaraspec.protocol.fields import show
from scaraspec.protocol.payloads import NameListPart
from scaraspec.suite.controller.harness.followed_setting import FollowedSetting
from scaraspec.suite.controller.harness.setting_values import (
    DEPENDS_ON,
    OUTPUTS,
    PROGRAMS,
    QUERIES,
    READ_BY,
    SET_BY,
    reported,
    requested_value,
    shown,
)
from scaraspec.suite.engine.system_under_test import Interference
from scaraspec.traffic.events import FrameSeen
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest

REASON: Final = "another client is using this robot"

_NAMES_A_FILE: Final = ("upload_name", "delete_program", "set_default_program")
_NS: Final = 1e9


@dataclass
class _Case:
    """The settings that a case used, their deviations, and why its failure does not count.

    Attributes:
        touched: The settings on which its replies depended.
        deviations: A sentence for each that deviated.
        suspicious: Whether one deviated suspiciously.
        reason: Why a failure does not count; empty if it counts.
    """

    touched: set[str] = field(default_factory=set)
    deviations: dict[str, str] = field(default_factory=dict)
    suspicious: bool = False
    reason: str = ""


class OtherClients(Interference):
    """Follows the settings of one controller.

    Attributes:
        settings: The settings, by name.
        deviating: What deviated in the running attempt at a case, and whether suspiciously.
    """

    def __init__(self, subject: "ControllerUnderTest") -> None:
        self._subject = subject
        self.settings = {name: FollowedSetting(subject.ics.time_scale) for name in QUERIES}
        self.deviating: dict[str, bool] = {}
        self._cases: dict[str, _Case] = {}
        self._proofs: dict[str, str] = {}
        self._parts: dict[str, list[bytes]] = {}
        self._uploads: list[bytes] = []

    # ------------------------------------------------------------------ what passes

    def begin(self) -> None:
        """Begin a case, or a repetition of it."""
        self.deviating = {}

    def sent(self, seen: FrameSeen) -> None:
        """Record a request that was sent."""
        if name := DEPENDS_ON.get(seen.name):
            self._case.touched.add(name)
        if seen.parsed is None:  # an undefined opcode may change any setting
            for setting in self.settings.values():
                setting.expected = None
        if seen.name == "upload_name":
            self._uploads.append(seen.frame.data)

    def answered(self, request: FrameSeen, *, accepted: bool) -> None:
        """Record the reply to a request that sets something or names a file."""
        if request.name in _NAMES_A_FILE and not accepted:
            self._case.touched.add(PROGRAMS)
        if name := SET_BY.get(request.name):
            value = requested_value(request, self.settings[OUTPUTS].expected)
            at_s = request.place.time_ns / _NS
            self.settings[name].note_request(value, request.frame.data, at_s, accepted=accepted)

    def received(self, connection: str, seen: FrameSeen) -> None:
        """Record a reply and compare it with the expected value."""
        name = READ_BY.get(seen.name)
        value = self._reported(connection, seen) if name else None
        if name is None or value is None:
            return
        expected = self.settings[name].expected
        suspicious = self.settings[name].note_report(value, seen.place.time_ns / _NS)
        if suspicious is None:
            return
        suspicious = suspicious or name == OUTPUTS
        self.deviating[name] = suspicious or self.deviating.get(name, False)
        self._case.suspicious |= suspicious
        sentence = UserMessage(
            "the {name} was {value} instead of {expected}",
            name=UserMessage(name),
            value=shown(value),
            expected=shown(expected),
        )
        self._case.deviations.setdefault(name, sentence)

    def _reported(self, connection: str, seen: FrameSeen) -> Any:
        """Return the value in a reply; None without a value or for an incomplete list."""
        part = seen.value
        if not isinstance(part, NameListPart):
            return reported(seen)
        names = self._parts.setdefault(connection, [])
        names += part.names
        return None if part.more else self._other_programs(self._parts.pop(connection))

    def _other_programs(self, names: Iterable[bytes]) -> frozenset[str] | None:
        """Return the differences of a program list from the start, without the suite's files."""
        listed = self._subject.journal.changes.settings.get("programs")
        if listed is None:
            return None
        before, now = {name.encode("latin-1") for name in listed}, set(names)
        more = {
            UserMessage("with {name}", name=show(name))
            for name in now - before
            if not self._may_be_own(name)
        }
        fewer = {UserMessage("without {name}", name=show(name)) for name in before - now}
        return frozenset(more | fewer)

    def _may_be_own(self, name: bytes) -> bool:
        """Whether the suite has sent this name, or this is a part of such a name."""
        if self._subject.files.prefix.lower() in name.lower():
            return True
        return any(name in own or (own and own in name) for own in self._uploads)

    # ------------------------------------------------------------------ conclusions

    @property
    def _case(self) -> _Case:
        """The running case; all time between the cases is one case."""
        return self._cases.setdefault(self._subject.observer.case, _Case())

    @property
    def touched(self) -> set[str]:
        """The settings on which the replies in the running case depended so far."""
        return self._case.touched

    @property
    def proved(self) -> bool:
        """Whether another client is known to have changed something."""
        return bool(self._proofs)

    @property
    def suspected(self) -> bool:
        """Whether something deviated suspiciously in the running attempt."""
        return any(self.deviating.values())

    def prove(self, name: str, was: Any, now: Any) -> None:
        """Record that a setting has changed while the suite sent only queries."""
        self._proofs[name] = UserMessage(
            "the {name} changed from {before} to {after} while the suite sent only queries",
            name=UserMessage(name),
            before=shown(was),
            after=shown(now),
        )
        self._notify(self._proofs[name])

    def passed_again(self) -> None:
        """Record that the case failed after a change by another client and passed again."""
        sentence = UserMessage.listed(self._case.deviations.values(), semicolons=True)
        self._case.reason = UserMessage(
            "{reason}, it seems: {sentence}; the case passed when it was repeated",
            reason=REASON,
            sentence=sentence,
        )
        self._notify(sentence)

    def _notify(self, sentence: str) -> None:
        if not any(REASON in notice for notice in self._subject.notices):
            consequence = "Findings that depend on it are inconclusive"
            self._subject.notify(
                UserMessage(
                    "{reason}: {sentence}. {consequence}",
                    reason=REASON,
                    sentence=sentence,
                    consequence=consequence,
                )
            )

    def reason(self, case: str) -> str:
        """Why a failure of this case does not count; empty if it does."""
        record = self._cases.get(case, _Case())
        if not case and record.suspicious:  # the time between the cases cannot be repeated
            return UserMessage(
                "{reason}, it seems: {sentence}",
                reason=REASON,
                sentence=UserMessage.listed(record.deviations.values(), semicolons=True),
            )
        if record.reason or not self._proofs:
            return record.reason
        foreign = {name for name, setting in self.settings.items() if setting.foreign}
        if not record.touched & (self._proofs.keys() | foreign | record.deviations.keys()):
            return ""
        seen = [s for n, s in record.deviations.items() if n not in self._proofs]
        sentence = UserMessage.listed((*self._proofs.values(), *seen), semicolons=True)
        return UserMessage("{reason}: {sentence}", reason=REASON, sentence=sentence)
