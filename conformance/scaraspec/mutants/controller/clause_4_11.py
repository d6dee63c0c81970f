"""Mutants of clause 4.11: deleting a program."""

from collections.abc import Callable
from fnmatch import fnmatchcase
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import (
    answer,
    answer_when,
    before,
    decoded,
    on_request,
    reads,
)
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request


def _finds_deleted(command: str) -> Core:
    """Deleted programs remain available for one command."""

    class FindsDeleted(ControllerCore):
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            self._deleted: dict[bytes, bytes] = {}

        def remove(self, name: bytes) -> bool:
            content = self.store.read(name) if name in self.store else None
            if content is None or not super().remove(name):
                return False
            self._deleted[name] = content
            return True

        def execute(self, request: Request) -> Any:
            name = request.value
            restored = name in self._deleted and name not in self.store
            if restored:
                self.store.write(name, self._deleted[name])
            reply = getattr(super(), command)(request)
            if restored:
                self.store.delete(name)
            return reply

    return type("Finds", (FindsDeleted,), {command: FindsDeleted.execute})


def _finds(fits: Callable[[bytes, bytes], bool]) -> Core:
    """If the name is not stored, the first stored name that `fits` accepts is deleted."""

    def find(core: ControllerCore, frame: Frame, value: bytes | None) -> bytes | None:
        requested = frame.data
        if requested in core.store:
            return value
        return next((name for name in core.store.names() if fits(requested, name)), value)

    return decoded("delete_program", find)


def _delete_neighbour(core: ControllerCore, request: Request) -> None:
    names = core.store.names()
    at = names.index(request.value) if request.value in names else 0
    if at and names[at - 1].startswith(request.value[:2]):
        core.remove(names[at - 1])


def _delete_running(core: ControllerCore, request: Request) -> None:
    if core.is_in_use(request.value):
        core.remove(request.value)


def _reset_gateway(core: ControllerCore, frame: Frame, value: bytes | None) -> bytes | None:
    if frame.data.startswith(b"../../"):
        core.save(gateway="0.0.0.0")  # noqa: S104 - nothing is bound
    return value


row(
    "deletion-answered-with-the-name",
    "4.11/2",
    "A deletion is answered with the flag and a word.",
    first_reply("delete_program", {b"1": b"1|deleted"}),
)
row(
    "deletion-answered-with-zero",
    "4.11/2",
    "A program is deleted but the answer is 0.",
    answer("delete_program", lambda _done: False),
)
row(
    "deletes-nothing",
    "4.11/3",
    "A deletion is answered 1 but the program remains.",
    on_request("delete_program", lambda core, request: request.value in core.store),
)
row(
    "deleted-programs-are-downloadable",
    "4.11/3",
    "A deleted program can be downloaded.",
    _finds_deleted("download_name"),
)
row(
    "deleted-programs-run",
    "4.11/3",
    "A deleted program can be run.",
    _finds_deleted("run_program"),
)
row(
    "deletes-its-neighbour",
    "4.11/3",
    "The preceding program of the list is also deleted if its name starts with the same two bytes.",
    before("delete_program", _delete_neighbour),
)
row(
    "deletes-nothing-that-runs",
    "4.11/3",
    "The deletion of a running program is answered 1 but the program remains.",
    answer_when("delete_program", lambda core, request: core.is_in_use(request.value), value=True),
    subtle=True,
)
row(
    "deletes-what-runs-unsaid",
    "4.11/2",
    "The deletion of a running program is answered 0 but the program is deleted.",
    before("delete_program", _delete_running),
    subtle=True,
)


@mutant("deletes-each-name-once", "4.11/3", subtle=True)
class DeletesEachNameOnce(ControllerCore):
    """The second deletion of the same name is answered 1 but the program remains."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._deleted: set[bytes] = set()

    def delete_program(self, request: Request) -> bool:
        if request.value in self._deleted:
            return request.value in self.store
        self._deleted.add(request.value)
        return super().delete_program(request)


row(
    "missing-is-deleted",
    "4.11/4",
    "The deletion of a missing program is answered 1.",
    answer_when(
        "delete_program", lambda core, request: request.value not in core.store, value=True
    ),
)
row(
    "deletes-by-beginning",
    "4.11/4",
    "The beginning of a name deletes the program.",
    _finds(lambda requested, name: bool(requested) and name.startswith(requested)),
)
row(
    "deletes-by-longer-name",
    "4.11/4",
    "Bytes after the name of a deleted program are ignored.",
    _finds(lambda requested, name: requested.startswith(name)),
)
row(
    "deletes-whatever-the-extension",
    "4.11/4",
    "A name without extension deletes the program with an extension.",
    _finds(lambda requested, name: bool(requested) and requested == name.rpartition(b".")[0]),
)
row(
    "deletes-by-pattern",
    "4.11/4",
    "Asterisks and question marks in a name are wildcards.",
    _finds(
        lambda requested, name: (
            bool(requested) and fnmatchcase(name.decode("latin-1"), requested.decode("latin-1"))
        )
    ),
)
row(
    "deletes-up-to-the-bar",
    "4.11/4",
    "A bar and the bytes after it are ignored, and the beginning of a name is sufficient.",
    _finds(
        lambda requested, name: b"|" in requested and name.startswith(requested.partition(b"|")[0])
    ),
)
row(
    "deletes-by-the-last-part",
    "4.11/6 4.11/4",
    "The last part of a path is used as name.",
    reads("delete_program", lambda data: data.rpartition(b"/")[2] or data),
)
row(
    "deletes-by-backslashes",
    "4.11/6 4.11/4",
    "The last part of a path with backslashes is used as name.",
    reads("delete_program", lambda data: data.rpartition(b"\\")[2] or data),
)
row(
    "paths-reach-the-settings",
    "4.11/6",
    "A name that leads out of the store is answered 0 but resets the gateway.",
    decoded("delete_program", _reset_gateway),
)
