"""Mutants of clause 4.10: the list of the programs."""

from collections.abc import Callable
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply, length_byte
from scaraspec.mutants.operators.controller.requests import before
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import NameListPart
from scaraspec.virtual_controller.behaviour.programs import list_parts
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session


def _reply(change: Callable[[bytes], bytes]) -> Core:
    return first_reply("list_programs", change)


def _names(change: Callable[[bytes], bytes]) -> Core:
    """The names and bars after flag and first bar are changed."""
    return _reply(lambda data: data[:2] + change(data[2:]))


class _ListsNames(ControllerCore):
    """Lists the names that `listed` returns."""

    def listed(self, names: list[bytes], request: Request) -> list[bytes]:  # noqa: ARG002 - subclasses use it
        return names

    def list_programs(self, request: Request) -> NameListPart:
        if not request.session.remaining_list_parts:
            names = self.listed(_programs(self), request)
            request.session.remaining_list_parts = list(list_parts(names))
        return super().list_programs(request)


def _programs(core: ControllerCore) -> list[bytes]:
    return [name for name in core.store.names() if core.is_program(name)]


def _lists(change: Callable[[list[bytes]], list[bytes]]) -> Core:
    """Other names than the stored ones are listed."""
    return type("Lists", (_ListsNames,), {"listed": lambda _core, names, _request: change(names)})


def _first_part(names: list[bytes]) -> int:
    """The number of names in the first part of a list."""
    return len(next(list_parts(names)).names)


def _cut_names(core: ControllerCore, request: Request) -> None:
    text = b"|".join(_programs(core))
    pieces = [text[i : i + 253] for i in range(0, len(text), 253)]
    if text:
        request.session.remaining_list_parts = [
            NameListPart(i < len(pieces), tuple(piece.split(b"|")))
            for i, piece in enumerate(pieces, 1)
        ]


def _repeat_at_boundary(names: list[bytes]) -> list[bytes]:
    size = _first_part(names)
    return names[:size] + names[size - 1 :] if size < len(names) else names


def _lose_at_boundary(names: list[bytes]) -> list[bytes]:
    size = _first_part(names)
    return names[:size] + names[size + 1 :]


row(
    "list-without-flag",
    "4.10/2",
    "The list has no flag; an empty list is the word none.",
    _reply(lambda data: data[2:] if len(data) > 1 else b"none"),
)
row(
    "list-flag-is-the-count",
    "4.10/2",
    "A list of several names starts with their number.",
    _reply(lambda data: b"%d" % n + data[1:] if (n := data.count(b"|")) > 1 else data),
)
row(
    "first-parts-are-last-ones",
    "4.10/2 4.10/5",
    "Every part starts with 0.",
    _reply(lambda data: b"0" + data[1:]),
)
row(
    "last-part-announces-another",
    "4.10/4 4.10/2",
    "The last part of a list with names starts with 1.",
    _reply(lambda data: b"1" + data[1:] if len(data) > 1 else data),
)


@mutant("last-of-several-parts-announces-another", "4.10/4", subtle=True)
class AnnouncesPartAfterLast(ControllerCore):
    """The last part of a list of several parts starts with 1."""

    _several = False

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x0B:
            is_last_of_several, self._several = self._several, frame.data[:1] == b"1"
            if is_last_of_several:
                frame = frame._replace(data=b"1" + frame.data[1:])
        super().emit(session, frame)


row(
    "list-between-commas",
    "4.10/3",
    "Commas separate the names.",
    _names(lambda names: names.replace(b"|", b",")),
)
row(
    "list-between-blanks",
    "4.10/3",
    "Blanks separate flag and names.",
    _reply(lambda data: data.replace(b"|", b" ")),
)
row(
    "list-between-line-ends",
    "4.10/3 4.10/11",
    "Line ends separate the names.",
    _names(lambda names: names.replace(b"|", b"\n")),
)
row(
    "names-are-torn",
    "4.10/6",
    "A long list is split where a frame is full, within a name.",
    before("list_programs", _cut_names),
)
row(
    "empty-name-between",
    "4.10/7",
    "There are two bars between the first two names.",
    _names(lambda names: names.replace(b"|", b"||", 1)),
)
row(
    "seam-is-listed-twice",
    "4.10/7",
    "The last name of the first part is also the first name of the next part.",
    _lists(_repeat_at_boundary),
    subtle=True,
)
row(
    "names-in-one-list-twice",
    "4.10/7",
    "If there are more than five programs, the fifth is listed twice.",
    _lists(lambda names: [*names, names[4]] if len(names) > 5 else names),
    subtle=True,
)
row(
    "empty-store-has-empty-name",
    "4.10/8",
    "The list of an empty store contains one empty name.",
    first_reply("list_programs", {b"0": b"0||"}),
)
row(
    "empty-store-is-dash",
    "4.10/8",
    "The list of an empty store is a dash.",
    first_reply("list_programs", {b"0": b"-"}),
)
row(
    "list-length-of-the-names",
    "4.10/9",
    "The length byte does not count flag and first bar, as in the table row of the document.",
    length_byte("list_programs", lambda size_bytes: max(size_bytes - 2, 1)),
)
row(
    "list-length-in-seven-bits",
    "4.10/9",
    "The length byte of a long list lacks its highest bit.",
    length_byte("list_programs", lambda size_bytes: size_bytes % 128),
    subtle=True,
)
row(
    "only-the-first-part",
    "4.10/11 4.10/5",
    "Only the first part of a list is sent.",
    _lists(lambda names: names[: _first_part(names)]),
)
row(
    "names-of-thirty-are-left-out",
    "4.10/11",
    "Names of thirty or more bytes are not listed.",
    _lists(lambda names: [name for name in names if len(name) < 30]),
    subtle=True,
)
row(
    "names-are-listed-in-lower-case",
    "4.10/11",
    "Names are listed in lower case.",
    _lists(lambda names: [name.lower() for name in names]),
)
row(
    "names-beyond-twenty-are-left-out",
    "4.10/11",
    "Only twenty names are listed.",
    _lists(lambda names: names[:20]),
    subtle=True,
)
row(
    "name-at-the-seam-is-lost",
    "4.10/11",
    "The first name of the second part is not listed.",
    _lists(_lose_at_boundary),
    subtle=True,
)


@mutant("others-uploads-are-listed-later", "4.10/11", subtle=True)
class ListsOwnUploads(_ListsNames):
    """A connection receives only the names of its own uploads."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._owners: dict[int, set[bytes]] = {}

    def listed(self, names: list[bytes], request: Request) -> list[bytes]:
        own = self._owners.get(request.session.connection, set())
        return [name for name in names if name in own]

    def upload_name(self, request: Request) -> bool:
        self._owners.setdefault(request.session.connection, set()).add(request.value)
        return super().upload_name(request)


@mutant("list-is-not-refreshed", "4.10/11", subtle=True)
class RepeatsList(_ListsNames):
    """A list that is not empty is sent three times before it is updated."""

    _old: tuple[int, list[bytes]] = (0, [])
    _count = 0

    def listed(self, names: list[bytes], request: Request) -> list[bytes]:  # noqa: ARG002 - the same for all
        self._count += 1
        since, shown = self._old
        if shown and self._count - since <= 2:
            return shown
        self._old = self._count, names
        return names


@mutant("deleted-programs-stay-listed", "4.10/11", "4.11/3")
class ListsDeletedPrograms(_ListsNames):
    """The list contains deleted programs."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._deleted: list[bytes] = []

    def listed(self, names: list[bytes], request: Request) -> list[bytes]:  # noqa: ARG002 - the same for all
        return [*names, *(name for name in self._deleted if name not in names)]

    def remove(self, name: bytes) -> bool:
        deleted = super().remove(name)
        if deleted:
            self._deleted.append(name)
        return deleted
