"""Mutants of clause 4.2: a new password."""

from typing import Any

from scaraspec.mutants.controller import mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import (
    after,
    answer,
    answer_when,
    decoded,
    executes_first,
    on_request,
)
from scaraspec.protocol.commands import PasswordChange
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request


def _old_is_right(core: ControllerCore, request: Request) -> bool:
    return bool(request.value.old == core.store.settings.password)


def _save_and_compare(core: ControllerCore, request: Request) -> bool:
    right = _old_is_right(core, request)
    core.save(password=request.value.new)
    return right


def _clear_password(core: ControllerCore, _frame: Frame, value: PasswordChange | None) -> Any:
    if value is None:
        core.save(password=b"")
    return value


row(
    "new-password-is-forgotten",
    "4.2/4",
    "A new password is answered 1 but not stored.",
    on_request("set_password", _old_is_right),
)


@mutant("old-password-still-opens", "4.2/4")
class AcceptsFormerPasswords(ControllerCore):
    """Replaced passwords are still accepted by logins."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._former: list[bytes] = []

    def set_password(self, request: Request) -> bool:
        self._former.append(self.store.settings.password)
        return super().set_password(request)

    def login(self, request: Request) -> bool:
        former = request.value in self._former
        request.session.logged_in |= former
        return super().login(request) or former


row(
    "new-password-is-cut",
    "4.2/4",
    "Only eight bytes of a new password are stored, but logins are compared in full.",
    after(
        "set_password",
        lambda core, request, done: done and core.save(password=request.value.new[:8]),
    ),
    subtle=True,
)


@mutant("second-change-is-forgotten", "4.2/4", subtle=True)
class ForgetsSecondChange(ControllerCore):
    """Only the first new password since power-on is stored; later ones are only answered 1."""

    _changed = False

    def set_password(self, request: Request) -> bool:
        if self._changed:
            return _old_is_right(self, request)
        self._changed = super().set_password(request)
        return self._changed


row(
    "one-change-per-connection",
    "4.2/4",
    "Only the first new password of a connection is stored; later ones are answered 1.",
    executes_first("set_password", 1),
    subtle=True,
)
row(
    "old-and-new-are-mixed-up",
    "4.2/4",
    "The old password is stored again in place of the new one.",
    after(
        "set_password", lambda core, request, done: done and core.save(password=request.value.old)
    ),
)
row(
    "old-password-is-not-checked",
    "4.2/3",
    "A new password is stored with any old password in the request.",
    on_request("set_password", lambda core, request: core.save(password=request.value.new)),
)
row(
    "beginning-of-the-old-password-will-do",
    "4.2/3",
    "The old password is compared only up to the length in the request.",
    on_request(
        "set_password",
        lambda core, request: (
            core.store.settings.password.startswith(request.value.old)
            and core.save(password=request.value.new)
        ),
    ),
)


@mutant("verified-once-and-for-all", "4.2/3", subtle=True)
class ChecksOldPasswordOnce(ControllerCore):
    """After one change of the password, the connection can change it with any old password."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._verified: set[int] = set()

    def set_password(self, request: Request) -> bool:
        connection = request.session.connection
        if super().set_password(request):
            self._verified.add(connection)
        elif connection in self._verified:
            self.save(password=request.value.new)
        else:
            return False
        return True


@mutant("old-password-is-that-of-the-login", "4.2/3", subtle=True)
class ComparesWithPasswordOfLogin(ControllerCore):
    """The old password is compared with the password of the login on the same connection."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._given: dict[int, bytes] = {}

    def login(self, request: Request) -> bool:
        right = super().login(request)
        if right:
            self._given[request.session.connection] = request.value
        return right

    def set_password(self, request: Request) -> bool:
        right = request.value.old == self._given.get(request.session.connection)
        return right and self.save(password=request.value.new)


row(
    "change-answered-with-zero",
    "4.2/2",
    "The password is changed but the answer is 0.",
    answer("set_password", lambda _done: False),
)
row(
    "change-answered-in-words",
    "4.2/2",
    "A new password is answered OK.",
    first_reply("set_password", {b"1": b"OK"}),
)
row(
    "refused-password-is-set",
    "4.2/5 4.2/3",
    "A new password with a wrong old one is answered 0 but stored.",
    on_request("set_password", _save_and_compare),
)
row(
    "malformed-change-clears-the-password",
    "4.2/5",
    "A malformed request is answered 0, and the password is empty afterwards.",
    decoded("set_password", _clear_password),
)
row(
    "pair-without-bar-is-taken",
    "4.2/6",
    "A request without separator is answered 1 and changes nothing.",
    decoded(
        "set_password",
        lambda _core, frame, value: value if b"|" in frame.data else PasswordChange(b"", b""),
    ),
    answer_when("set_password", lambda _core, request: request.value == (b"", b""), value=True),
)
