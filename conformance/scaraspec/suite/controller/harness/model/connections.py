"""Steps that open connections, log in and change the password."""

from contextlib import suppress
from typing import Final

from scaraspec.protocol.fields import show
from scaraspec.suite.controller.harness.model.state import READING, ModelState, Step
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.passwords import (
    expect_password_changed,
    request_password_change,
    usable_passwords,
)
from scaraspec.suite.controller.harness.suite_passwords import PLAIN_PASSWORD
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect
from scaraspec.user_message import UserMessage

_ALONE: Final = 3  # one of so many reconnections closes all connections


class ConnectionSteps(ModelState):
    """Opens connections and logs in."""

    def _reconnect(self, step: Step, line: OutgoingConnection) -> str:
        """Open a connection again, and compare a state on it that was set on any connection.

        In some turns, no other connection is open at this time.
        """
        if step.turn % _ALONE == 0:
            for other in self._lines:
                other.close()
            self._lines = [self._connection() for _ in self._lines]
            new = self._lines[0]
        else:
            new = self._replace(line)
        if acts := [act for act in READING if act in self._acts]:
            act = acts[step.turn % len(acts)]
            getattr(self, f"_{act}")(step._replace(act=act), new)
        return UserMessage("reconnect ({connection})", connection=self._lines.index(new))

    def _replace(self, line: OutgoingConnection) -> OutgoingConnection:
        """Close a connection, and return a new one in its place."""
        line.close()
        new = self._lines[self._lines.index(line)] = self._connection()
        return new

    def _log_in(self, _: Step, line: OutgoingConnection) -> str | None:
        if not self._subject.access.needs_login:
            return None
        self._subject.log_in(line, self._password)
        return UserMessage("log in again")

    def _log_in_wrongly(self, _: Step, _line: OutgoingConnection) -> str | None:
        if not (self._subject.supports_multiple_connections and self._subject.access.needs_login):
            return None
        if not self._subject.may_try_wrong_password():
            return None
        other = self._subject.open(login=False)
        try:
            answer = other.ask("login", b"no-" + self._password)
        except NoReply:
            silent = other.ending is None
            other.close()
            if silent and self._serves_another():
                raise
            return None  # it serves no third connection (A-2-2)
        expect(
            answer.accepted is False,
            "a wrong password was accepted",
            expected="0",
            observed=f"{answer}",
            requirement="4.1/3",
        )
        with suppress(NoReply):  # two failures in a row may lock the suite out
            other.ask("login", self._password)
        other.close()
        return UserMessage("log in with a wrong password elsewhere")

    def _serves_another(self) -> bool:
        """Whether another connection is served; it may be served after one was closed."""
        third = self._subject.open(login=False)
        try:
            return third.ask("login", self._password).accepted is True
        except NoReply:
            return False
        finally:
            third.close()

    def _set_password(self, step: Step, line: OutgoingConnection) -> str | None:
        if not self._subject.access.needs_login:
            return None
        passwords = (self._subject.password, *usable_passwords(self._subject))
        return self._change_password(passwords[step.value % len(passwords)], line)

    def _change_password(self, new: bytes, line: OutgoingConnection) -> str:
        if not expect_password_changed(line, self._password, new):
            return UserMessage("set the password {password}, refused", password=show(new))
        self._password = new
        self._reconnect_all("4.2/4", "the next login with the new password was refused")
        return UserMessage("set the password {password}", password=show(new))

    def _mistake_password(self, step: Step, line: OutgoingConnection) -> str | None:
        """Change the password with a wrong old one, and perhaps with the right one after that."""
        if not self._subject.access.needs_login or not self._subject.may_try_wrong_password():
            return None
        # If a change follows, it must not set the password of the refused request.
        is_followed = step.value % 2
        unwanted = self._password if is_followed else PLAIN_PASSWORD
        answer = request_password_change(line, self._password + b"-no", unwanted)
        expect(
            answer.accepted is False,
            "the password was changed although the old one was wrong",
            expected="0",
            observed=f"{answer}",
            requirement="4.2/3",
        )
        done = UserMessage("change the password with a wrong old one")
        if is_followed:
            known = self._password == PLAIN_PASSWORD
            new = self._subject.password if known else PLAIN_PASSWORD
            return UserMessage.listed([done, self._change_password(new, line)], semicolons=True)
        self._reconnect_all("4.2/5", "the next login with the password was refused")
        return done

    def _reconnect_all(self, requirement: str, message: str) -> None:
        """Open all connections again: the login may be lost (A-4.2-2)."""
        for line in self._lines:
            line.close()
        try:
            self._lines = [self._connection() for _ in self._lines]
        except NoReply:
            raise
        except CaseFailed as error:
            raise CaseFailed(message, observed=error.observed, requirement=requirement) from None
