"""Faults of clause 4.10: the list of the programs."""

from abc import ABC, abstractmethod
from typing import Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersLengths, AltersReplies
from scaraspec.protocol.payloads import NameListPart
from scaraspec.virtual_controller.behaviour.programs import list_parts
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_LIST: Final = 0x0B
_PART_BYTES: Final = 253
_MOST: Final = 20


class _AltersNames(ControllerCore, ABC):
    """Other names are listed than are stored."""

    @abstractmethod
    def listed(self, names: list[bytes], request: Request) -> list[bytes]:
        """Which names are listed, of those that are stored."""

    def list_programs(self, request: Request) -> NameListPart:
        """List them."""
        names = [name for name in self.store.names() if self.is_program(name)]
        if not request.session.remaining_list_parts:
            request.session.remaining_list_parts = list(list_parts(self.listed(names, request)))
        return super().list_programs(request)


@mutant("list-without-flag", "4.10/2")
class ListWithoutFlag(AltersReplies):
    """The list begins with its first name, or has no data."""

    opcode = _LIST

    def altered(self, data: bytes) -> bytes:
        """Leave the flag away."""
        return data[2:] if len(data) > 1 else b"none"


@mutant("list-flag-is-the-count", "4.10/2")
class ListFlagIsTheCount(AltersReplies):
    """The list begins with the number of its names."""

    opcode = _LIST

    def altered(self, data: bytes) -> bytes:
        """Count them."""
        return b"%d" % data.count(b"|") + data[1:] if data.count(b"|") > 1 else data


@mutant("first-parts-are-last-ones", "4.10/2", "4.10/5")
class FirstPartsAreLastOnes(AltersReplies):
    """Every part begins with 0, whether another follows or not."""

    opcode = _LIST

    def altered(self, data: bytes) -> bytes:
        """Deny what follows."""
        return b"0" + data[1:]


@mutant("last-part-announces-another", "4.10/4", "4.10/2")
class LastPartAnnouncesAnother(AltersReplies):
    """A list that has names begins with 1 in its last part, too."""

    opcode = _LIST

    def altered(self, data: bytes) -> bytes:
        """Announce another one."""
        return b"1" + data[1:] if len(data) > 1 else data


@mutant("last-of-several-parts-announces-another", "4.10/4", subtle=True)
class LastOfSeveralPartsAnnouncesAnother(AltersReplies):
    """In a list of several parts the last one begins with 1, too."""

    opcode = _LIST
    _several = False

    def altered(self, data: bytes) -> bytes:
        """Announce another one."""
        before, self._several = self._several, data[:1] == b"1"
        return b"1" + data[1:] if before else data


@mutant("list-between-commas", "4.10/3")
class ListBetweenCommas(AltersReplies):
    """Names are separated by commas."""

    opcode = _LIST

    def altered(self, data: bytes) -> bytes:
        """Put them in."""
        return data[:2] + data[2:].replace(b"|", b",")


@mutant("list-between-blanks", "4.10/3")
class ListBetweenBlanks(AltersReplies):
    """Flag and names are separated by blanks."""

    opcode = _LIST

    def altered(self, data: bytes) -> bytes:
        """Put them in."""
        return data.replace(b"|", b" ")


@mutant("list-between-line-ends", "4.10/3", "4.10/11")
class ListBetweenLineEnds(AltersReplies):
    """Names are separated by line ends, as in a file."""

    opcode = _LIST

    def altered(self, data: bytes) -> bytes:
        """Put them in."""
        return data[:2] + data[2:].replace(b"|", b"\n")


@mutant("names-are-torn", "4.10/6")
class NamesAreTorn(ControllerCore):
    """A list that is too long is cut where its message is full, in the middle of a name."""

    def list_programs(self, request: Request) -> NameListPart:
        """Cut by bytes."""
        names = [name for name in self.store.names() if self.is_program(name)]
        text = b"|".join(names)
        pieces = [text[i : i + _PART_BYTES] for i in range(0, len(text), _PART_BYTES)]
        last = len(pieces) - 1
        if text:
            request.session.remaining_list_parts = [
                NameListPart(i < last, tuple(piece.split(b"|"))) for i, piece in enumerate(pieces)
            ]
        return super().list_programs(request)


@mutant("empty-name-between", "4.10/7")
class EmptyNameBetween(AltersReplies):
    """Between two names stand two bars."""

    opcode = _LIST

    def altered(self, data: bytes) -> bytes:
        """Double one of them."""
        return data[:2] + data[2:].replace(b"|", b"||", 1)


@mutant("seam-is-listed-twice", "4.10/7", subtle=True)
class SeamIsListedTwice(_AltersNames):
    """The last name of a part is the first one of the next part again."""

    def listed(self, names: list[bytes], request: Request) -> list[bytes]:  # noqa: ARG002 - whoever asks
        """Repeat it."""
        first = next(list_parts(names))
        return [*names[: len(first.names)], *names[len(first.names) - 1 :]] if first.more else names


@mutant("names-in-one-list-twice", "4.10/7", subtle=True)
class NamesInOneListTwice(_AltersNames):
    """Of more than five programs the fifth is listed twice."""

    def listed(self, names: list[bytes], request: Request) -> list[bytes]:  # noqa: ARG002 - whoever asks
        """Repeat the fifth."""
        return [*names, names[4]] if len(names) > 5 else names


@mutant("empty-store-has-empty-name", "4.10/8")
class EmptyStoreHasEmptyName(AltersReplies):
    """An empty store is listed as one empty name."""

    opcode = _LIST

    def altered(self, data: bytes) -> bytes:
        """Add its bars."""
        return b"0||" if data == b"0" else data


@mutant("empty-store-is-dash", "4.10/8")
class EmptyStoreIsDash(AltersReplies):
    """An empty store is listed as a dash."""

    opcode = _LIST

    def altered(self, data: bytes) -> bytes:
        """Draw it."""
        return b"-" if data == b"0" else data


@mutant("list-length-of-the-names", "4.10/9")
class ListLengthOfTheNames(AltersLengths):
    """The length byte counts the list behind its flag, as in the document's row."""

    opcode = _LIST

    def length(self, size_bytes: int) -> int:
        """Leave flag and bar out."""
        return max(size_bytes - 2, 1)


@mutant("list-length-in-seven-bits", "4.10/9", subtle=True)
class ListLengthInSevenBits(AltersLengths):
    """Of the length of a long list the highest bit is missing."""

    opcode = _LIST

    def length(self, size_bytes: int) -> int:
        """Drop it."""
        return size_bytes % 128


@mutant("only-the-first-part", "4.10/11", "4.10/5")
class OnlyTheFirstPart(AltersReplies):
    """Of a list the first message is sent, and nothing behind it."""

    opcode = _LIST

    def altered(self, data: bytes) -> bytes:
        """Say that it is the last one."""
        return b"0" + data[1:]

    def list_programs(self, request: Request) -> NameListPart:
        """Forget the rest."""
        first = super().list_programs(request)
        request.session.remaining_list_parts = []
        self._deferred.clear()
        return first


@mutant("names-of-thirty-are-left-out", "4.10/11", subtle=True)
class NamesOfThirtyAreLeftOut(_AltersNames):
    """Names of thirty bytes are not listed."""

    def listed(self, names: list[bytes], request: Request) -> list[bytes]:  # noqa: ARG002 - whoever asks
        """Leave them out."""
        return [name for name in names if len(name) < 30]


@mutant("names-are-listed-in-lower-case", "4.10/11")
class NamesAreListedInLowerCase(_AltersNames):
    """Names are listed in lower case."""

    def listed(self, names: list[bytes], request: Request) -> list[bytes]:  # noqa: ARG002 - whoever asks
        """Write them so."""
        return [name.lower() for name in names]


@mutant("names-beyond-twenty-are-left-out", "4.10/11", subtle=True)
class NamesBeyondTwentyAreLeftOut(_AltersNames):
    """No more than twenty names are listed."""

    def listed(self, names: list[bytes], request: Request) -> list[bytes]:  # noqa: ARG002 - whoever asks
        """Leave the others out."""
        return names[:_MOST]


@mutant("name-at-the-seam-is-lost", "4.10/11", subtle=True)
class NameAtTheSeamIsLost(_AltersNames):
    """The name that did not fit into a part is not in the next one either."""

    def listed(self, names: list[bytes], request: Request) -> list[bytes]:  # noqa: ARG002 - whoever asks
        """Lose it."""
        first = next(list_parts(names))
        lost = len(first.names)
        return names[:lost] + names[lost + 1 :] if first.more else names


@mutant("others-uploads-are-listed-later", "4.10/11", subtle=True)
class OthersUploadsAreListedLater(_AltersNames):
    """A connection is not told of what others uploaded before it."""

    def listed(self, names: list[bytes], request: Request) -> list[bytes]:
        """Look at who uploaded it."""
        own = self._owners.get(request.session.connection, set())
        return [name for name in names if name in own]

    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)  # type: ignore[arg-type] # as its base is made
        self._owners: dict[int, set[bytes]] = {}

    def upload_name(self, request: Request) -> bool:
        """Remember who uploads what."""
        self._owners.setdefault(request.session.connection, set()).add(request.value)
        return super().upload_name(request)


@mutant("list-is-not-refreshed", "4.10/11", subtle=True)
class ListIsNotRefreshed(_AltersNames):
    """A list is shown three times before a newer one is."""

    _old: tuple[int, list[bytes]] = (0, [])
    _count = 0

    def listed(self, names: list[bytes], request: Request) -> list[bytes]:  # noqa: ARG002 - whoever asks
        """Show an old one for a while."""
        self._count += 1
        at, shown = self._old
        if not shown or self._count - at > 2:
            self._old = self._count, names
            return names
        return shown


@mutant("deleted-programs-stay-listed", "4.10/11", "4.11/3")
class DeletedProgramsStayListed(_AltersNames):
    """The list goes on to name what was deleted."""

    def listed(self, names: list[bytes], request: Request) -> list[bytes]:  # noqa: ARG002 - whoever asks
        """Add them."""
        return [*names, *(name for name in self._gone if name not in names)]

    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)  # type: ignore[arg-type] # as its base is made
        self._gone: list[bytes] = []

    def remove(self, name: bytes) -> bool:
        """Remember it."""
        gone = super().remove(name)
        if gone:
            self._gone.append(name)
        return gone
