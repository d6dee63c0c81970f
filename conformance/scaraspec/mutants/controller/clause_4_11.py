"""Faults of clause 4.11: deleting a program."""

from abc import ABC, abstractmethod
from fnmatch import fnmatchcase
from typing import Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies, Mends
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_DELETE: Final = 0x0C


@mutant("deletion-answered-with-the-name", "4.11/2")
class DeletionAnsweredWithTheName(AltersReplies):
    """A deletion is answered with more than its flag."""

    opcode = _DELETE

    def altered(self, data: bytes) -> bytes:
        """Add a word."""
        return data + b"|deleted" if data == b"1" else data


@mutant("deletion-answered-with-zero", "4.11/2")
class DeletionAnsweredWithZero(ControllerCore):
    """A program is deleted, and the answer is 0."""

    def delete_program(self, request: Request) -> bool:
        """Delete it, and say the contrary."""
        super().delete_program(request)
        return False


@mutant("deletes-nothing", "4.11/3")
class DeletesNothing(ControllerCore):
    """A deletion is answered 1, and the program stays."""

    def delete_program(self, request: Request) -> bool:
        """Only look for it."""
        return request.value in self.store


class _Hides(ControllerCore):
    """A program that is deleted is listed no more, and is still kept."""

    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)  # type: ignore[arg-type] # as its base is made
        self._kept: dict[bytes, bytes] = {}

    def remove(self, name: bytes) -> bool:
        """Keep its bytes."""
        content = self.store.read(name) if name in self.store else None
        if content is None or not super().remove(name):
            return False
        self._kept[name] = content
        return True


@mutant("deleted-programs-are-downloadable", "4.11/3")
class DeletedProgramsAreDownloadable(_Hides):
    """What was deleted can still be downloaded."""

    def download_name(self, request: Request) -> bool:
        """Offer it again."""
        name = request.value
        hidden = name not in self.store and name in self._kept
        if hidden:
            self.store.write(name, self._kept[name])
        answer = super().download_name(request)
        if hidden:
            self.store.delete(name)
        return answer


@mutant("deleted-programs-run", "4.11/3")
class DeletedProgramsRun(_Hides):
    """What was deleted can still be run."""

    def run_program(self, request: Request) -> Acceptance:
        """Run it from memory."""
        name = request.value
        hidden = name is not None and name not in self.store and name in self._kept
        if hidden:
            self.store.write(name, self._kept[name])
        answer = super().run_program(request)
        if hidden:
            self.store.delete(name)
        return answer


@mutant("deletes-its-neighbour", "4.11/3")
class DeletesItsNeighbour(ControllerCore):
    """With a program the one that is listed before it is deleted, too."""

    def delete_program(self, request: Request) -> bool:
        """Delete both."""
        names = self.store.names()
        at = names.index(request.value) if request.value in names else 0
        if at and names[at - 1].startswith(request.value[:2]):
            self.remove(names[at - 1])
        return super().delete_program(request)


@mutant("deletes-nothing-that-runs", "4.11/3", subtle=True)
class DeletesNothingThatRuns(ControllerCore):
    """The deletion of a program that runs is answered 1, and it stays."""

    def delete_program(self, request: Request) -> bool:
        """Promise it."""
        return self.is_in_use(request.value) or super().delete_program(request)


@mutant("deletes-what-runs-unsaid", "4.11/2", subtle=True)
class DeletesWhatRunsUnsaid(ControllerCore):
    """The deletion of a program that runs is answered 0, and it is deleted."""

    def delete_program(self, request: Request) -> bool:
        """Delete it, whatever is said."""
        runs = self.is_in_use(request.value)
        return (
            self.remove(request.value) if runs else super().delete_program(request)
        ) and not runs


@mutant("deletes-each-name-once", "4.11/3", subtle=True)
class DeletesEachNameOnce(ControllerCore):
    """A name that was deleted before is deleted no more, though the answer is 1."""

    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)  # type: ignore[arg-type] # as its base is made
        self._deleted: set[bytes] = set()

    def delete_program(self, request: Request) -> bool:
        """Remember it."""
        if request.value in self._deleted:
            return request.value in self.store
        self._deleted.add(request.value)
        return super().delete_program(request)


@mutant("missing-is-deleted", "4.11/4")
class MissingIsDeleted(ControllerCore):
    """The deletion of a program that is not stored is answered 1: it is not there, as wanted."""

    def delete_program(self, request: Request) -> bool:
        """Be content."""
        return request.value not in self.store or super().delete_program(request)


class _FindsMore(Mends, ABC):
    """A name that is not stored stands for one that is."""

    command = "delete_program"

    def mended(self, data: bytes) -> bytes:
        """The first that fits."""
        if data in self.store:
            return data
        return next((name for name in self.store.names() if self.fits(data, name)), data)

    @abstractmethod
    def fits(self, asked: bytes, name: bytes) -> bool:
        """Whether a name stands for another one."""


@mutant("deletes-by-beginning", "4.11/4")
class DeletesByBeginning(_FindsMore):
    """The beginning of a name stands for it."""

    def fits(self, asked: bytes, name: bytes) -> bool:
        """Compare as far as it goes."""
        return bool(asked) and name.startswith(asked)


@mutant("deletes-by-longer-name", "4.11/4")
class DeletesByLongerName(_FindsMore):
    """What stands behind a name is not looked at."""

    def fits(self, asked: bytes, name: bytes) -> bool:
        """Compare as far as the name goes."""
        return asked.startswith(name)


@mutant("deletes-whatever-the-extension", "4.11/4")
class DeletesWhateverTheExtension(_FindsMore):
    """A name stands for the one with an extension."""

    def fits(self, asked: bytes, name: bytes) -> bool:
        """Leave the extension out."""
        return bool(asked) and asked == name.rpartition(b".")[0]


@mutant("deletes-by-pattern", "4.11/4")
class DeletesByPattern(_FindsMore):
    """Asterisks and question marks in a name stand for whatever there is."""

    def fits(self, asked: bytes, name: bytes) -> bool:
        """Match it."""
        return bool(asked) and fnmatchcase(name.decode("latin-1"), asked.decode("latin-1"))


@mutant("deletes-up-to-the-bar", "4.11/4")
class DeletesUpToTheBar(Mends):
    """What stands behind a bar in a name is not looked at."""

    command = "delete_program"

    def mended(self, data: bytes) -> bytes:
        """Find a program by what stands before it."""
        head = data.partition(b"|")[0]
        if b"|" in data:
            return next((name for name in self.store.names() if name.startswith(head)), data)
        return data


@mutant("deletes-by-the-last-part", "4.11/6", "4.11/4")
class DeletesByTheLastPart(Mends):
    """Of a path the last part is the name."""

    command = "delete_program"

    def mended(self, data: bytes) -> bytes:
        """Leave directories away."""
        return data.rpartition(b"/")[2] or data


@mutant("deletes-by-backslashes", "4.11/6", "4.11/4")
class DeletesByBackslashes(Mends):
    """Of a path of Windows the last part is the name."""

    command = "delete_program"

    def mended(self, data: bytes) -> bytes:
        """Leave directories away."""
        return data.rpartition(b"\\")[2] or data


@mutant("paths-reach-the-settings", "4.11/6")
class PathsReachTheSettings(Mends):
    """A name that leads out of the store is answered 0, and takes settings of the robot away."""

    command = "delete_program"

    def mended(self, data: bytes) -> bytes:
        """Go back to those of the factory."""
        if data.startswith(b"../../"):
            self.save(gateway="0.0.0.0")  # noqa: S104 - nothing is bound
        return data
