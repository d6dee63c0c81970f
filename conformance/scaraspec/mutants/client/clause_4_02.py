"""Faults of 4.2: setting the password."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any

from scaraspec.client.core import ClientCore
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersFields
from scaraspec.protocol.commands import BY_NAME, PasswordChange
from scaraspec.protocol.frames import Frame


@mutant("new-password-first", "4.2/1")
class NewPasswordFirst(AltersFields):
    """The new password is sent ahead of the old one."""

    name = "set_password"

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Swap them."""
        return fields[::-1]


@mutant("new-password-alone", "4.2/1")
class NewPasswordAlone(AltersFields):
    """The new password is sent without the old one."""

    name = "set_password"

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Leave it out."""
        return fields[1:]


@mutant("repeats-the-new-password", "4.2/1", subtle=True)
class RepeatsTheNewPassword(AltersFields):
    """The new password is sent twice, as forms ask for it."""

    name = "set_password"

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Repeat it."""
        return [*fields, fields[-1]]


class _SendsAnyPair(ClientCore, ABC):
    """A pair that must not be sent is sent."""

    _pair = b""

    @abstractmethod
    def passes(self, pair: PasswordChange) -> bytes:
        """What is sent of it; nothing where it is refused."""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        """Take it for another one."""
        if name == "set_password" and (pair := self.passes(value)):
            self._pair, value = pair, PasswordChange(b"o", b"n")
        return super().command(name, value)

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            meant = self._pair and frame.opcode == BY_NAME["set_password"].opcode
            super()._send([frame._replace(data=self._pair) if meant else frame])
            self._pair = b"" if meant else self._pair


@mutant("looks-for-bars-in-new-ones", "4.2/7", "T/6", subtle=True)
class LooksForBarsInNewOnes(_SendsAnyPair):
    """Only the new password is looked through for bars."""

    def passes(self, pair: PasswordChange) -> bytes:
        """Look."""
        return b"|".join(pair) if b"|" in pair.old and b"|" not in pair.new else b""


@mutant("cuts-long-pairs", "4.2/7", "T/10")
class CutsLongPairs(_SendsAnyPair):
    """A pair of passwords that is too long is cut."""

    def passes(self, pair: PasswordChange) -> bytes:
        """Cut it."""
        whole = b"|".join(pair)
        return whole[:255] if len(whole) > 255 else b""
