"""Faults of clause 6.5: files that it does not allow, and that are run all the same (6.5/28)."""

from dataclasses import replace
from itertools import pairwise
from typing import ClassVar, Final

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.program_files import NodeType, Program, ProgramError, Severity, lint, parse
from scaraspec.protocol.program_files.layout import DEFAULT_LAYOUT, FOOTER, MAGIC
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.interpreter import Run

_BUFFER_BYTES: Final = 512


class _Mends(ControllerCore):
    """Makes a right file of a wrong one."""

    def mended(self, data: bytes) -> bytes:
        """The file that it reads."""
        return data

    def parse_program(self, data: bytes) -> Program | None:
        """Read what was made of it."""
        return super().parse_program(self.mended(data))


@mutant("reads-no-scara", "6.5/28")
class ReadsNoScara(_Mends):
    """Nobody looks whether a file begins with SCARA."""

    def mended(self, data: bytes) -> bytes:
        """Write it."""
        return MAGIC + data[len(MAGIC) :]


@mutant("reads-no-aracs", "6.5/28")
class ReadsNoAracs(_Mends):
    """Nobody looks whether a file ends with ARACS."""

    def mended(self, data: bytes) -> bytes:
        """Write it."""
        return data[: -len(FOOTER)] + FOOTER


@mutant("reads-no-aracs-of-long-files", "6.5/28", subtle=True)
class ReadsNoAracsOfLongFiles(ReadsNoAracs):
    """Nobody looks whether a file of more than 512 bytes ends with ARACS."""

    def mended(self, data: bytes) -> bytes:
        """Write it."""
        return super().mended(data) if len(data) > _BUFFER_BYTES else data


@mutant("reads-four-letters-of-scara", "6.5/28")
class ReadsFourLettersOfScara(_Mends):
    """The last letter of SCARA may be any, as where a NUL is thought to stand."""

    def mended(self, data: bytes) -> bytes:
        """Write it."""
        return MAGIC + data[len(MAGIC) :] if data.startswith(MAGIC[:4]) else data


@mutant("reads-scara-in-small-letters", "6.5/28")
class ReadsScaraInSmallLetters(_Mends):
    """The marks may be written in small letters."""

    def mended(self, data: bytes) -> bytes:
        """Write them large."""
        head, foot = data[: len(MAGIC)].upper(), data[-len(FOOTER) :].upper()
        return head + data[len(MAGIC) : -len(FOOTER)] + foot


@mutant("reads-scara-for-aracs", "6.5/28")
class ReadsScaraForAracs(_Mends):
    """A file may end with SCARA as it begins."""

    def mended(self, data: bytes) -> bytes:
        """Write what is due."""
        return data[: -len(FOOTER)] + FOOTER if data.endswith(MAGIC) else data


@mutant("ignores-what-is-too-much", "6.5/28")
class IgnoresWhatIsTooMuch(_Mends):
    """What a file has beyond its counted nodes is left out."""

    def mended(self, data: bytes) -> bytes:
        """Cut it off."""
        if len(data) < DEFAULT_LAYOUT.header_bytes:
            return data
        end = DEFAULT_LAYOUT.file_bytes(*DEFAULT_LAYOUT.counts(data))
        return data[: end - len(FOOTER)] + FOOTER if end < len(data) else data


@mutant("fills-what-is-missing", "6.5/28")
class FillsWhatIsMissing(_Mends):
    """What a file lacks at its end counts as zeros."""

    def mended(self, data: bytes) -> bytes:
        """Fill it."""
        if len(data) < DEFAULT_LAYOUT.header_bytes:
            return data
        end = DEFAULT_LAYOUT.file_bytes(*DEFAULT_LAYOUT.counts(data))
        if not len(data) < end < len(data) + DEFAULT_LAYOUT.node_bytes:
            return data
        return data[: -len(FOOTER)].ljust(end - len(FOOTER), b"\0") + FOOTER


@mutant("runs-nothing-of-damaged-files", "6.5/28")
class RunsNothingOfDamagedFiles(ControllerCore):
    """A damaged file is run as a program without nodes."""

    def parse_program(self, data: bytes) -> Program:
        """Something, in any case."""
        return super().parse_program(data) or Program()


@mutant("runs-the-program-before", "6.5/28")
class RunsTheProgramBefore(ControllerCore):
    """In place of a damaged file the last right one is run."""

    _before: Program | None = None

    def parse_program(self, data: bytes) -> Program | None:
        """Remember what was right."""
        self._before = super().parse_program(data) or self._before
        return self._before


class _Patient(Run):
    """Passes over markers without a partner."""

    def _partner(self) -> int:
        partner = self._structure.partners[self._index]
        return self._index if partner is None else partner


class _Forgives(ControllerCore):
    """Runs what has some errors."""

    interpreter = _Patient
    forgiven: ClassVar[frozenset[str]]

    def parse_program(self, data: bytes) -> Program | None:
        """Look for other errors only."""
        try:
            program = parse(data)
        except ProgramError:
            return None
        errors = {finding.code for finding in lint(program) if finding.severity is Severity.ERROR}
        return self.made(program) if errors <= self.forgiven else None

    def made(self, program: Program) -> Program:
        """The program that it runs."""
        return program


@mutant("takes-keys-twice", "6.5/28")
class TakesKeysTwice(_Forgives):
    """Two variables may have the same key."""

    forgiven = frozenset({"P-key-twice"})


@mutant("takes-keys-twice-apart", "6.5/28", subtle=True)
class TakesKeysTwiceApart(_Forgives):
    """Two variables may have the same key unless they are neighbours."""

    forgiven = frozenset({"P-key-twice"})

    def parse_program(self, data: bytes) -> Program | None:
        """Look at neighbours."""
        program = super().parse_program(data)
        if program is None:
            return None
        keys = [variable.key for variable in program.variables]
        return None if any(a == b for a, b in pairwise(keys)) else program


class _Straightens(_Forgives):
    """Runs curves as straight moves."""

    def made(self, program: Program) -> Program:
        """Replace them."""
        nodes = [
            replace(node, type=NodeType.STRAIGHT_MOVE) if node.type == NodeType.CURVE_MOVE else node
            for node in program.nodes
        ]
        return replace(program, nodes=tuple(nodes))


@mutant("takes-short-curves", "6.5/28")
class TakesShortCurves(_Straightens):
    """A curve may have fewer than three points."""

    forgiven = frozenset({"P-curve-short"})


@mutant("takes-other-nodes-in-curves", "6.5/28")
class TakesOtherNodesInCurves(_Straightens):
    """A curve may have other nodes than points."""

    forgiven = frozenset({"P-curve-child"})


@mutant("looks-at-three-points-of-acurve", "6.5/28", subtle=True)
class LooksAtThreePointsOfACurve(TakesOtherNodesInCurves):
    """Behind its third point a curve may have other nodes than points."""

    def parse_program(self, data: bytes) -> Program | None:
        """Look at those only."""
        program = super().parse_program(data)
        if program is not None:
            nodes = parse(data).nodes
            for at, node in enumerate(nodes):
                points = [child.type == NodeType.POINT for child in nodes[at + 1 : at + 4]]
                if node.type == NodeType.CURVE_MOVE and not all(points):
                    return None
        return program


@mutant("takes-open-loops", "6.5/28")
class TakesOpenLoops(_Forgives):
    """A loop may lack its end, and an end its loop."""

    forgiven = frozenset({"P-loop"})


@mutant("takes-open-branches", "6.5/28")
class TakesOpenBranches(_Forgives):
    """An IF may lack its ENDIF, and an ENDIF its IF."""

    forgiven = frozenset({"P-if"})


@mutant("takes-stray-else", "6.5/28")
class TakesStrayElse(_Forgives):
    """An ELSE may stand anywhere and any number of times."""

    forgiven = frozenset({"P-else"})
