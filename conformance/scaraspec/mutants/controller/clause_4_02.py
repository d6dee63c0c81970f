"""Faults of clause 4.2: a new password."""

from typing import Any, Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies
from scaraspec.protocol.commands import Command, PasswordChange
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_CUT_BYTES: Final = 8


@mutant("new-password-is-forgotten", "4.2/4")
class NewPasswordIsForgotten(ControllerCore):
    """A new password is answered 1 and not set."""

    def set_password(self, request: Request) -> bool:
        """Only look at the old one."""
        return bool(request.value.old == self.store.settings.password)


@mutant("old-password-still-opens", "4.2/4")
class OldPasswordStillOpens(ControllerCore):
    """Passwords that were replaced go on to open logins."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._former: list[bytes] = []

    def set_password(self, request: Request) -> bool:
        """Keep the old one."""
        self._former.append(self.store.settings.password)
        return super().set_password(request)

    def login(self, request: Request) -> bool:
        """Take any of them."""
        former = request.value in self._former
        request.session.logged_in |= former
        return super().login(request) or former


@mutant("new-password-is-cut", "4.2/4", subtle=True)
class NewPasswordIsCut(ControllerCore):
    """Of a new password eight bytes are kept, while logins are compared in full."""

    def set_password(self, request: Request) -> bool:
        """Cut it."""
        if not super().set_password(request):
            return False
        return self.save(password=request.value.new[:_CUT_BYTES])


@mutant("second-change-is-forgotten", "4.2/4", subtle=True)
class SecondChangeIsForgotten(ControllerCore):
    """Only the first new password since power-on is set; further ones are just answered 1."""

    _changed = False

    def set_password(self, request: Request) -> bool:
        """Set the first one."""
        if self._changed:
            return bool(request.value.old == self.store.settings.password)
        self._changed = super().set_password(request)
        return self._changed


@mutant("old-and-new-are-mixed-up", "4.2/4")
class OldAndNewAreMixedUp(ControllerCore):
    """The old password is set again in place of the new one."""

    def set_password(self, request: Request) -> bool:
        """Save the wrong field."""
        return super().set_password(request) and self.save(password=request.value.old)


@mutant("old-password-is-not-checked", "4.2/3")
class OldPasswordIsNotChecked(ControllerCore):
    """A new password is set whatever the old one is said to be."""

    def set_password(self, request: Request) -> bool:
        """Set it."""
        return self.save(password=request.value.new)


@mutant("beginning-of-the-old-password-will-do", "4.2/3")
class BeginningOfTheOldPasswordWillDo(ControllerCore):
    """The old password is compared only as far as it is sent."""

    def set_password(self, request: Request) -> bool:
        """Compare the beginning."""
        right = self.store.settings.password.startswith(request.value.old)
        return right and self.save(password=request.value.new)


@mutant("verified-once-and-for-all", "4.2/3", subtle=True)
class VerifiedOnceAndForAll(ControllerCore):
    """Who has changed the password once needs no old one any more, on that connection."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._verified: set[int] = set()

    def set_password(self, request: Request) -> bool:
        """Remember who knew it."""
        connection = request.session.connection
        if super().set_password(request):
            self._verified.add(connection)
        elif connection in self._verified:
            self.save(password=request.value.new)
        else:
            return False
        return True


@mutant("old-password-is-that-of-the-login", "4.2/3", subtle=True)
class OldPasswordIsThatOfTheLogin(ControllerCore):
    """The old password is compared with what its connection has logged in with."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._given: dict[int, bytes] = {}

    def login(self, request: Request) -> bool:
        """Remember it."""
        right = super().login(request)
        if right:
            self._given[request.session.connection] = request.value
        return right

    def set_password(self, request: Request) -> bool:
        """Compare with it."""
        right = request.value.old == self._given.get(request.session.connection)
        return right and self.save(password=request.value.new)


@mutant("change-answered-with-zero", "4.2/2")
class ChangeAnsweredWithZero(ControllerCore):
    """The password is changed, and the answer is 0."""

    def set_password(self, request: Request) -> bool:
        """Change it, and say the contrary."""
        super().set_password(request)
        return False


@mutant("change-answered-in-words", "4.2/2")
class ChangeAnsweredInWords(AltersReplies):
    """The answer to a new password is a word."""

    opcode = 0x03

    def altered(self, data: bytes) -> bytes:
        """Say it in words."""
        return b"OK" if data == b"1" else data


@mutant("refused-password-is-set", "4.2/5", "4.2/3")
class RefusedPasswordIsSet(ControllerCore):
    """A new password with a wrong old one is answered 0 and set all the same."""

    def set_password(self, request: Request) -> bool:
        """Save before looking."""
        right = bool(request.value.old == self.store.settings.password)
        self.save(password=request.value.new)
        return right


@mutant("malformed-change-clears-the-password", "4.2/5")
class MalformedChangeClearsThePassword(ControllerCore):
    """A pair that is none is answered 0 and leaves an empty password behind."""

    def _value(self, command: Command, frame: Frame) -> Any:
        value = super()._value(command, frame)
        if command.name == "set_password" and value is None:
            self.save(password=b"")
        return value


@mutant("pair-without-bar-is-taken", "4.2/6")
class PairWithoutBarIsTaken(ControllerCore):
    """A request without separator is answered 1, and changes nothing."""

    def _value(self, command: Command, frame: Frame) -> Any:
        if command.name == "set_password" and b"|" not in frame.data:
            return PasswordChange(b"", b"")
        return super()._value(command, frame)

    def set_password(self, request: Request) -> bool:
        """Say yes to nothing."""
        return request.value == (b"", b"") or super().set_password(request)
