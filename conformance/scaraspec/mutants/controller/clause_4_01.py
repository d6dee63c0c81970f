"""Faults of clause 4.1: the login."""

from typing import Any, Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies
from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.behaviour import SILENCE, Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

_LOGIN: Final = 0x01
_LOGINS: Final = 7


@mutant("refuses-second-login", "4.1/2", subtle=True)
class RefusesSecondLogin(ControllerCore):
    """Who has logged in and does so again is answered 0."""

    def login(self, request: Request) -> bool:
        """Refuse it."""
        return not request.session.logged_in and super().login(request)


@mutant("every-seventh-login-fails", "4.1/2", "4.1/6", subtle=True)
class EverySeventhLoginFails(ControllerCore):
    """Every seventh login since power-on is answered 0, right as it is."""

    _count = 0

    def login(self, request: Request) -> bool:
        """Count them."""
        self._count += 1
        return super().login(request) and self._count % _LOGINS != 0


@mutant("login-behind-version-fails", "4.1/6", "4.1/2", subtle=True)
class LoginBehindVersionFails(ControllerCore):
    """The first login after the version was asked for is refused: a buffer is used for both."""

    _spoilt = False

    def get_version(self, request: Request) -> str:
        """Spoil the password."""
        self._spoilt = True
        return super().get_version(request)

    def login(self, request: Request) -> bool:
        """Compare it with what is in the buffer."""
        spoilt, self._spoilt = self._spoilt, False
        return not spoilt and super().login(request)


@mutant("wrong-password-bars-the-connection", "4.1/2", "4.1/7", subtle=True)
class WrongPasswordBarsTheConnection(ControllerCore):
    """A connection on which a wrong password was tried can log in no more."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._barred: set[int] = set()

    def login(self, request: Request) -> bool:
        """Remember who was wrong."""
        right = request.session.connection not in self._barred and super().login(request)
        if not right:
            self._barred.add(request.session.connection)
        return right


@mutant("wrong-password-costs-the-next-login", "4.1/2", "4.1/7", subtle=True)
class WrongPasswordCostsTheNextLogin(ControllerCore):
    """After a wrong password the next right one on another connection is refused once."""

    _wrong_on = -1

    def login(self, request: Request) -> bool:
        """Remember the last wrong one."""
        connection = request.session.connection
        if self._wrong_on not in (-1, connection):
            self._wrong_on = -1
            return False
        right = super().login(request)
        self._wrong_on = -1 if right and self._wrong_on == -1 else self._wrong_on
        if not right:
            self._wrong_on = connection
        return right


@mutant("any-password-opens", "4.1/3")
class AnyPasswordOpens(ControllerCore):
    """Whatever password is sent, it is answered 1."""

    def login(self, request: Request) -> bool:
        """Let everybody in."""
        request.session.logged_in = True
        return True


@mutant("the-passwords-length-opens", "4.1/3")
class ThePasswordsLengthOpens(ControllerCore):
    """Passwords are compared by their lengths."""

    def login(self, request: Request) -> bool:
        """Compare the lengths."""
        right = len(request.value) == len(self.store.settings.password)
        request.session.logged_in |= right
        return right


@mutant("the-beginning-of-the-password-opens", "4.1/3")
class TheBeginningOfThePasswordOpens(ControllerCore):
    """Passwords are compared as far as the one that was sent goes."""

    def login(self, request: Request) -> bool:
        """Compare the beginnings."""
        right = self.store.settings.password.startswith(request.value)
        request.session.logged_in |= right
        return right


@mutant("more-than-the-password-opens", "4.1/3")
class MoreThanThePasswordOpens(ControllerCore):
    """Passwords are compared as far as the one that is set goes."""

    def login(self, request: Request) -> bool:
        """Compare the beginnings."""
        right: bool = request.value.startswith(self.store.settings.password)
        request.session.logged_in |= right
        return right


@mutant("password-in-any-letter-case", "4.1/3")
class PasswordInAnyLetterCase(ControllerCore):
    """Letter case makes no difference in passwords."""

    def login(self, request: Request) -> bool:
        """Compare them in lower case."""
        right = bool(request.value.lower() == self.store.settings.password.lower())
        request.session.logged_in |= right
        return right


@mutant("no-password-opens", "4.1/3")
class NoPasswordOpens(ControllerCore):
    """A login without any password is answered 1."""

    def _value(self, command: Command, frame: Frame) -> Any:
        if command.name == "login" and not frame.data:
            return self.store.settings.password
        return super()._value(command, frame)


@mutant("wrong-password-meets-silence", "4.1/3")
class WrongPasswordMeetsSilence(ControllerCore):
    """A wrong password is not answered."""

    def login(self, request: Request) -> bool | Silence:  # type: ignore[override] # silence is the fault
        """Answer only the right one."""
        return super().login(request) or SILENCE


@mutant("login-refused-with-code", "4.1/4")
class LoginRefusedWithCode(AltersReplies):
    """A refused login bears a code of table 8-1."""

    opcode = _LOGIN

    def altered(self, data: bytes) -> bytes:
        """Add a reason."""
        return b"0|05" if data == b"0" else data


@mutant("login-answered-ok", "4.1/4", "4.1/2")
class LoginAnsweredOk(AltersReplies):
    """A right password is answered with more than its flag."""

    opcode = _LOGIN

    def altered(self, data: bytes) -> bytes:
        """Add a word, once anybody is in."""
        others = [session for session in self.sessions.values() if session.logged_in]
        return b"1|ok" if data == b"1" and len(others) > 1 else data


@mutant("login-answered-twice", "4.1/4")
class LoginAnsweredTwice(ControllerCore):
    """A login that is repeated is answered twice."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Send the second answer again."""
        super().emit(session, frame)
        if frame.opcode == _LOGIN and session in self._greeted:
            super().emit(session, frame)
        self._greeted.append(session)

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._greeted: list[Session] = []
