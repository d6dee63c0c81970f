"""Faults of 4.9 to 4.11: the running program, the program list, deletion."""

from typing import Any, ClassVar

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore
from scaraspec.client.pending_operation import PendingOperation, ProgramListing
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersReplies, AltersRequests
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import NameListPart

# 4.9


@mutant("asks-for-the-first-program", "4.9/1")
class AsksForTheFirstProgram(AltersRequests):
    """The running program is asked for with a number."""

    name = "get_running_program"

    def altered(self, data: bytes) -> bytes:
        """Append it."""
        return data + b"1"


# 4.10


@mutant("asks-for-the-part", "4.10/1")
class AsksForThePart(AltersRequests):
    """The program list is asked for with the number of a part."""

    name = "list_programs"

    def altered(self, data: bytes) -> bytes:
        """Append it."""
        return data + b"0"


class _OtherListing(ClientCore):
    """The program list is put together otherwise."""

    shape: ClassVar[type[ProgramListing]]

    def command(self, name: str, value: Any = None) -> PendingOperation:
        """Take the other way."""
        if name != "list_programs":
            return super().command(name, value)
        return self.shape(BY_NAME[name], value, self.dialect)


@mutant("first-part-only", "4.10/10")
class FirstPartOnly(_OtherListing):
    """Of a list only the first part is told."""

    class shape(ProgramListing):  # noqa: N801 - it fills in the attribute
        """Ends with the first."""

        def _accept(self, value: NameListPart, now_s: float) -> list[Frame]:
            return super()._accept(value._replace(more=False), now_s)


@mutant("last-part-only", "4.10/10")
class LastPartOnly(_OtherListing):
    """Of a list only the last part is told."""

    class shape(ProgramListing):  # noqa: N801 - it fills in the attribute
        """Begins anew with each."""

        def _accept(self, value: NameListPart, now_s: float) -> list[Frame]:
            self._names.clear()
            return super()._accept(value, now_s)


@mutant("loses-the-first-of-later-parts", "4.10/10", subtle=True)
class LosesTheFirstOfLaterParts(_OtherListing):
    """The first name of each further part is lost, if there are others behind it."""

    class shape(ProgramListing):  # noqa: N801 - it fills in the attribute
        """Skips it."""

        def _accept(self, value: NameListPart, now_s: float) -> list[Frame]:
            if self._parts_received and len(value.names) > 1:
                value = value._replace(names=value.names[1:])
            return super()._accept(value, now_s)


@mutant("sixteen-parts", "4.10/10", subtle=True)
class SixteenParts(_OtherListing):
    """A list ends with its sixteenth part."""

    class shape(ProgramListing):  # noqa: N801 - it fills in the attribute
        """Ends there."""

        def _accept(self, value: NameListPart, now_s: float) -> list[Frame]:
            more = value.more and self._parts_received < 15
            return super()._accept(value._replace(more=more), now_s)


@mutant("joins-names-of-parts", "4.10/10", subtle=True)
class JoinsNamesOfParts(_OtherListing):
    """The last name of a part is taken for the beginning of the first of the next."""

    class shape(ProgramListing):  # noqa: N801 - it fills in the attribute
        """Joins them."""

        def _accept(self, value: NameListPart, now_s: float) -> list[Frame]:
            if self._names and value.names:
                value = value._replace(names=(self._names.pop() + value.names[0], *value.names[1:]))
            return super()._accept(value, now_s)


@mutant("fetches-in-vain", "4.10/10", reading=("list_cont=request",), subtle=True)
class FetchesInVain(_OtherListing):
    """The further parts of a list are asked for, and the last of them is not told (A-4.10-3 b)."""

    class shape(ProgramListing):  # noqa: N801 - it fills in the attribute
        """Forgets the last."""

        def _accept(self, value: NameListPart, now_s: float) -> list[Frame]:
            forgotten = self._parts_received and not value.more
            return super()._accept(value._replace(names=()) if forgotten else value, now_s)


@mutant("hides-dotted-names", "4.10/10", "T/9", subtle=True)
class HidesDottedNames(_OtherListing):
    """Names that begin with a dot are not told, as files that a system hides."""

    class shape(ProgramListing):  # noqa: N801 - it fills in the attribute
        """Leaves them out."""

        def _accept(self, value: NameListPart, now_s: float) -> list[Frame]:
            shown = tuple(name for name in value.names if not name.startswith(b"."))
            return super()._accept(value._replace(names=shown), now_s)


@mutant("takes-the-flag-for-text", "4.10/10", subtle=True)
class TakesTheFlagForText(AltersReplies):
    """Where no bar follows the flag of a list, the flag is told as part of the first name."""

    name = "list_programs"

    def altered(self, data: bytes) -> bytes:
        """Keep it."""
        return data if data[1:2] in (b"|", b"") else data[:1] + b"|" + data


@mutant("impatient-for-parts", "4.10/10", subtle=True)
class ImpatientForParts(_OtherListing):
    """A part that takes longer than a twentieth of a second is not waited for."""

    class shape(ProgramListing):  # noqa: N801 - it fills in the attribute
        """Is content with what there is."""

        def _accept(self, value: NameListPart, now_s: float) -> list[Frame]:
            frames = super()._accept(value, now_s)
            if value.more:
                self.deadline_s = now_s + 0.07
            return frames

        def expire(self, now_s: float) -> list[Frame]:  # noqa: ARG002 - another one would ask again
            """End with what has come."""
            self.settle(tuple(self._names))
            return []


@mutant("sorts-names", "4.10/10", "T/9", subtle=True)
class SortsNames(AsyncClient):
    """Programs are told in alphabetical order."""

    async def list_programs(self) -> tuple[str, ...]:
        """Sort them."""
        return tuple(sorted(await super().list_programs()))


@mutant("empty-list-is-one-name", "4.10/12")
class EmptyListIsOneName(AsyncClient):
    """An empty list is told as one empty name."""

    async def list_programs(self) -> tuple[str, ...]:
        """Make it up."""
        return await super().list_programs() or ("",)


@mutant("bar-is-one-name", "4.10/12", subtle=True)
class BarIsOneName(AltersReplies):
    """An empty list with a bar behind its flag is told as one name."""

    name = "list_programs"

    def altered(self, data: bytes) -> bytes:
        """Make it up."""
        return b"0|-" if data == b"0|" else data


@mutant("cuts-listed-names", "4.10/12", "T/9", subtle=True)
class CutsListedNames(AltersReplies):
    """Listed names are cut to thirty bytes."""

    name = "list_programs"

    def altered(self, data: bytes) -> bytes:
        """Cut them."""
        return b"|".join(text[:30] for text in data.split(b"|"))


@mutant("fails-at-long-names", "4.10/12", subtle=True)
class FailsAtLongNames(AltersReplies):
    """A list with a name of more than a hundred bytes cannot be read."""

    name = "list_programs"

    def altered(self, data: bytes) -> bytes:
        """Read it, or not."""
        return b"?" if max(map(len, data.split(b"|"))) > 100 else data


# 4.11


@mutant("adds-extensions", "4.11/1")
class AddsExtensions(AltersRequests):
    """The name of the program to delete is sent with an extension if it has none."""

    name = "delete_program"

    def altered(self, data: bytes) -> bytes:
        """Append it."""
        return data if b"." in data else data + b".rob"


@mutant("replaces-extensions", "4.11/1")
class ReplacesExtensions(AltersRequests):
    """The name of the program to delete is sent with the extension .rob for .txt."""

    name = "delete_program"

    def altered(self, data: bytes) -> bytes:
        """Replace it."""
        return data.removesuffix(b".txt") + b".rob" if data.endswith(b".txt") else data


@mutant("names-in-small-letters", "4.11/1")
class NamesInSmallLetters(AltersRequests):
    """The name of the program to delete is sent in small letters."""

    name = "delete_program"

    def altered(self, data: bytes) -> bytes:
        """Make it so."""
        return data.lower()


@mutant("ends-names-at-blanks", "4.11/1", subtle=True)
class EndsNamesAtBlanks(AltersRequests):
    """The name of the program to delete is sent up to its first blank."""

    name = "delete_program"

    def altered(self, data: bytes) -> bytes:
        """Cut it."""
        return data.partition(b" ")[0]
