"""Mutants of clause 4.1: the login."""

from collections.abc import Callable
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import (
    answer,
    answer_when,
    decoded,
    on_request,
)
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session


def _compare(is_right: Callable[[bytes, bytes], bool]) -> Core:
    """A login succeeds if `is_right` accepts the sent and the set password."""

    def login(core: ControllerCore, request: Request) -> bool:
        right = is_right(request.value, core.store.settings.password)
        request.session.logged_in |= right
        return right

    return on_request("login", login)


row(
    "refuses-second-login",
    "4.1/2",
    "A login on a connection that is already logged in is answered 0.",
    answer_when("login", lambda _core, request: request.session.logged_in, value=False),
    subtle=True,
)


@mutant("every-seventh-login-fails", "4.1/2", "4.1/6", subtle=True)
class RefusesEverySeventhLogin(ControllerCore):
    """Every seventh login since power-on is answered 0, even with the right password."""

    _count = 0

    def login(self, request: Request) -> bool:
        self._count += 1
        return super().login(request) and self._count % 7 != 0


@mutant("login-behind-version-fails", "4.1/6", "4.1/2", subtle=True)
class RefusesLoginAfterVersion(ControllerCore):
    """The first login after a version request is refused: both use the same buffer."""

    _overwritten = False

    def get_version(self, request: Request) -> str:
        self._overwritten = True
        return super().get_version(request)

    def login(self, request: Request) -> bool:
        overwritten, self._overwritten = self._overwritten, False
        return not overwritten and super().login(request)


@mutant("wrong-password-bars-the-connection", "4.1/2", "4.1/7", subtle=True)
class BarsConnectionAfterWrongPassword(ControllerCore):
    """After a wrong password every login on the same connection is refused."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._barred: set[int] = set()

    def login(self, request: Request) -> bool:
        right = request.session.connection not in self._barred and super().login(request)
        if not right:
            self._barred.add(request.session.connection)
        return right


@mutant("wrong-password-costs-the-next-login", "4.1/2", "4.1/7", subtle=True)
class RefusesLoginAfterWrongPassword(ControllerCore):
    """After a wrong password the next login on another connection is refused once."""

    _wrong_on = -1

    def login(self, request: Request) -> bool:
        connection = request.session.connection
        if self._wrong_on not in (-1, connection):
            self._wrong_on = -1
            return False
        right = super().login(request)
        if not right:
            self._wrong_on = connection
        return right


row(
    "any-password-opens",
    "4.1/3",
    "A login with any password is answered 1.",
    _compare(lambda _sent, _password: True),
)
row(
    "the-passwords-length-opens",
    "4.1/3",
    "Only the lengths of passwords are compared.",
    _compare(lambda sent, password: len(sent) == len(password)),
)
row(
    "the-beginning-of-the-password-opens",
    "4.1/3",
    "Passwords are compared only up to the length of the password in the login.",
    _compare(lambda sent, password: password.startswith(sent)),
)
row(
    "more-than-the-password-opens",
    "4.1/3",
    "Passwords are compared only up to the length of the stored password.",
    _compare(lambda sent, password: sent.startswith(password)),
)
row(
    "password-in-any-letter-case",
    "4.1/3",
    "Passwords are compared without regard to upper and lower case.",
    _compare(lambda sent, password: sent.lower() == password.lower()),
)
row(
    "no-password-opens",
    "4.1/3",
    "A login without a password is answered 1.",
    decoded("login", lambda c, frame, value: value if frame.data else c.store.settings.password),
)
row(
    "wrong-password-meets-silence",
    "4.1/3",
    "A login with a wrong password is not answered.",
    answer("login", lambda right: right or SILENCE),
)
row(
    "login-refused-with-code",
    "4.1/4",
    "The reply to a refused login contains a code of table 8-1.",
    first_reply("login", {b"0": b"0|05"}),
)


@mutant("login-answered-ok", "4.1/4", "4.1/2")
class AnswersSecondClientOk(ControllerCore):
    """While another client is logged in, a right password is answered 1|ok."""

    def emit(self, session: Session, frame: Frame) -> None:
        clients = sum(each.logged_in for each in self.sessions.values())
        if frame.opcode == 0x01 and frame.data == b"1" and clients > 1:
            frame = frame._replace(data=b"1|ok")
        super().emit(session, frame)


@mutant("login-answered-twice", "4.1/4")
class RepeatsLoginReply(ControllerCore):
    """A login after an earlier reply on the same connection is answered twice."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._answered: set[Session] = set()

    def emit(self, session: Session, frame: Frame) -> None:
        super().emit(session, frame)
        if frame.opcode == 0x01 and session in self._answered:
            super().emit(session, frame)
        self._answered.add(session)
