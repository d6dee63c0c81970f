"""The input of an operator becomes the client's report."""

import os
import pty
from collections.abc import Callable, Iterator
from contextlib import closing

import pytest

from scaraspec.suite.client.harness.attended import HELP, Attended
from scaraspec.suite.engine.expectations import CaseSkipped

Sitting = tuple[Attended, Callable[[str], None], list[str]]


@pytest.fixture
def sitting() -> Iterator[Sitting]:
    """Return an attended client, a function that types, and the lines shown."""
    read: list[str] = []
    ours, theirs = os.pipe()
    with closing(Attended("127.0.0.1", 0, read.append, input_fd=ours)) as attended:
        yield attended, lambda text: _write(theirs, text), read
    os.close(ours)
    os.close(theirs)


def _write(fd: int, text: str) -> None:
    os.write(fd, text.encode())


@pytest.mark.parametrize(("typed", "ok"), [("y\n", True), (" NO \n", False), ("?\n\nyes\n", True)])
def test_answers(sitting: Sitting, typed: str, ok: object) -> None:
    """A question is answered by yes or no; other input before it is ignored."""
    attended, types, _ = sitting
    question = attended.ask_operator("it glows")
    types(typed)
    attended.pump()
    assert question.ok is ok


def test_a_client_that_refuses(sitting: Sitting) -> None:
    """ "n" typed for a step means that the client refuses it; "y" has no effect."""
    attended, types, read = sitting
    call = attended.begin("delete_program", name="a")
    types("y\n")
    attended.pump()
    assert call.answer is None
    assert read[-2:] == [HELP, "now: delete_program with name = a"]
    types("n\n")
    attended.pump()
    assert call.failed


def test_an_input_counts_once(sitting: Sitting) -> None:
    """Extra input does not answer the next question."""
    attended, types, _ = sitting
    first = attended.ask_operator("it glows")
    types("y\ny\n")
    attended.pump()
    second = attended.ask_operator("it smokes")
    attended.pump()
    assert first.ok
    assert second.answer is None


@pytest.mark.parametrize(("typed", "raised"), [("s\n", CaseSkipped), ("q\n", KeyboardInterrupt)])
def test_leaving(sitting: Sitting, typed: str, raised: type[BaseException]) -> None:
    """The operator can skip a case or leave the session at any time."""
    attended, types, _ = sitting
    types(typed)
    with pytest.raises(raised):
        attended.pump()


def test_a_lost_terminal_ends_the_session() -> None:
    """A lost terminal ends the session."""
    near, far = pty.openpty()
    with closing(Attended("127.0.0.1", 0, print, input_fd=far)) as attended:
        os.close(near)
        with pytest.raises(KeyboardInterrupt):
            attended.pump()
    os.close(far)
