"""Mutants of clauses 4.9 to 4.11: the running program, the program list, deletion."""

from collections.abc import Callable

from scaraspec.client.core import ClientCore
from scaraspec.client.pending_operation import ProgramListing
from scaraspec.mutants.client import row
from scaraspec.mutants.operators.client.messages import (
    operations,
    reply_data,
    request_data,
    returned,
)
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import NameListPart

# 4.9

row(
    "asks-for-the-first-program",
    "4.9/1",
    "The request for the running program contains a number.",
    request_data("get_running_program", lambda data: data + b"1"),
)

# 4.10


def _parts(
    change: Callable[[NameListPart, int, list[bytes]], NameListPart],
) -> type[ClientCore]:
    """Parts of the program list are changed, given the number and the names of earlier parts."""

    class Parts(ProgramListing):
        def _accept(self, value: NameListPart, now_s: float) -> list[Frame]:
            return super()._accept(change(value, self._parts_received, self._names), now_s)

    return operations(Parts, "list_programs")


def _only_last(part: NameListPart, _: int, names: list[bytes]) -> NameListPart:
    names.clear()
    return part


def _without_first(part: NameListPart, earlier: int, _: list[bytes]) -> NameListPart:
    return part._replace(names=part.names[1:]) if earlier and len(part.names) > 1 else part


def _joined(part: NameListPart, _: int, names: list[bytes]) -> NameListPart:
    if names and part.names:
        return part._replace(names=(names.pop() + part.names[0], *part.names[1:]))
    return part


def _without_dotted(part: NameListPart, _: int, __: list[bytes]) -> NameListPart:
    return part._replace(names=tuple(name for name in part.names if not name.startswith(b".")))


class _GivesUpParts(ProgramListing):
    def _accept(self, value: NameListPart, now_s: float) -> list[Frame]:
        frames = super()._accept(value, now_s)
        if value.more:
            self.deadline_s = now_s + 0.07
        return frames

    def expire(self, now_s: float) -> list[Frame]:  # noqa: ARG002 - another one would ask again
        self.settle(tuple(self._names))
        return []


row(
    "asks-for-the-part",
    "4.10/1",
    "The request for the program list contains the number of a part.",
    request_data("list_programs", lambda data: data + b"0"),
)
row(
    "first-part-only",
    "4.10/10",
    "Only the first part of a program list is returned.",
    _parts(lambda part, _, __: part._replace(more=False)),
)
row(
    "last-part-only",
    "4.10/10",
    "Only the last part of a program list is returned.",
    _parts(_only_last),
)
row(
    "loses-the-first-of-later-parts",
    "4.10/10",
    "The first name of each further part is lost if other names follow it.",
    _parts(_without_first),
    subtle=True,
)
row(
    "sixteen-parts",
    "4.10/10",
    "A program list ends with its sixteenth part.",
    _parts(lambda part, earlier, _: part._replace(more=part.more and earlier < 15)),
    subtle=True,
)
row(
    "joins-names-of-parts",
    "4.10/10",
    "The last name of a part and the first name of the next part are joined.",
    _parts(_joined),
    subtle=True,
)
row(
    "fetches-in-vain",
    "4.10/10",
    "The last of several parts that were requested is not returned (A-4.10-3 b).",
    _parts(lambda part, earlier, _: part._replace(names=()) if earlier and not part.more else part),
    reading=("list_cont=request",),
    subtle=True,
)
row(
    "hides-dotted-names",
    "4.10/10 T/9",
    "Names that begin with a dot are not returned.",
    _parts(_without_dotted),
    subtle=True,
)
row(
    "takes-the-flag-for-text",
    "4.10/10",
    "If no bar follows the flag of a list, the flag is returned as part of the first name.",
    reply_data(
        "list_programs",
        lambda data: data if data[1:2] in (b"|", b"") else data[:1] + b"|" + data,
    ),
    subtle=True,
)
row(
    "impatient-for-parts",
    "4.10/10",
    "A program list ends if its next part does not arrive within 70 ms.",
    operations(_GivesUpParts, "list_programs"),
    subtle=True,
)
row(
    "sorts-names",
    "4.10/10 T/9",
    "Programs are returned in alphabetical order.",
    returned("list_programs", lambda names: tuple(sorted(names))),
    subtle=True,
)
row(
    "empty-list-is-one-name",
    "4.10/12",
    "An empty list is returned as one empty name.",
    returned("list_programs", lambda names: names or ("",)),
)
row(
    "bar-is-one-name",
    "4.10/12",
    "An empty list with a bar after its flag is returned as one name.",
    reply_data("list_programs", {b"0|": b"0|-"}),
    subtle=True,
)
row(
    "cuts-listed-names",
    "4.10/12 T/9",
    "Listed names are cut to 30 bytes.",
    reply_data("list_programs", lambda data: b"|".join(text[:30] for text in data.split(b"|"))),
    subtle=True,
)
row(
    "fails-at-long-names",
    "4.10/12",
    "A list with a name of more than 100 bytes cannot be read.",
    reply_data(
        "list_programs", lambda data: b"?" if max(map(len, data.split(b"|"))) > 100 else data
    ),
    subtle=True,
)

# 4.11

row(
    "adds-extensions",
    "4.11/1",
    "The extension .rob is added to the name of a program to delete without extension.",
    request_data("delete_program", lambda data: data if b"." in data else data + b".rob"),
)
row(
    "replaces-extensions",
    "4.11/1",
    "The name of a program to delete is sent with .rob in place of .txt.",
    request_data(
        "delete_program",
        lambda data: data.removesuffix(b".txt") + b".rob" if data.endswith(b".txt") else data,
    ),
)
row(
    "names-in-small-letters",
    "4.11/1",
    "The name of a program to delete is sent in lower case.",
    request_data("delete_program", bytes.lower),
)
row(
    "ends-names-at-blanks",
    "4.11/1",
    "The name of a program to delete is cut at its first space.",
    request_data("delete_program", lambda data: data.partition(b" ")[0]),
    subtle=True,
)
