"""Mutants of clause 6.5: invalid program files that are executed (6.5/28)."""

from itertools import pairwise

from scaraspec.mutants.controller import mutant, row
from scaraspec.mutants.operators.controller.programs import (
    accepts_errors,
    program_file,
    straightened,
)
from scaraspec.protocol.program_files import NodeType, Program, parse
from scaraspec.protocol.program_files.layout import DEFAULT_LAYOUT, FOOTER, MAGIC
from scaraspec.virtual_controller.core import ControllerCore

_HEAD, _FOOT = len(MAGIC), len(FOOTER)


def _with_magic(data: bytes) -> bytes:
    return MAGIC + data[_HEAD:]


def _with_footer(data: bytes) -> bytes:
    return data[:-_FOOT] + FOOTER


def _capitals(data: bytes) -> bytes:
    return data[:_HEAD].upper() + data[_HEAD:-_FOOT] + data[-_FOOT:].upper()


def _cut(data: bytes) -> bytes:
    if len(data) < DEFAULT_LAYOUT.header_bytes:
        return data
    end = DEFAULT_LAYOUT.file_bytes(*DEFAULT_LAYOUT.counts(data))
    return data[: end - _FOOT] + FOOTER if end < len(data) else data


def _fill(data: bytes) -> bytes:
    if len(data) < DEFAULT_LAYOUT.header_bytes:
        return data
    end = DEFAULT_LAYOUT.file_bytes(*DEFAULT_LAYOUT.counts(data))
    if not len(data) < end < len(data) + DEFAULT_LAYOUT.node_bytes:
        return data
    return data[:-_FOOT].ljust(end - _FOOT, b"\0") + FOOTER


row(
    "reads-no-scara",
    "6.5/28",
    "The magic SCARA at the beginning of a file is not checked.",
    program_file(_with_magic),
)
row(
    "reads-no-aracs",
    "6.5/28",
    "The footer ARACS at the end of a file is not checked.",
    program_file(_with_footer),
)
row(
    "reads-no-aracs-of-long-files",
    "6.5/28",
    "The footer ARACS of a file of more than 512 bytes is not checked.",
    program_file(lambda data: _with_footer(data) if len(data) > 512 else data),
    subtle=True,
)
row(
    "reads-four-letters-of-scara",
    "6.5/28",
    "The last letter of SCARA is not checked.",
    program_file(lambda data: _with_magic(data) if data.startswith(MAGIC[:4]) else data),
)
row(
    "reads-scara-in-small-letters",
    "6.5/28",
    "The magic and the footer may be written in lower case.",
    program_file(_capitals),
)
row(
    "reads-scara-for-aracs",
    "6.5/28",
    "A file may end with SCARA in place of ARACS.",
    program_file(lambda data: _with_footer(data) if data.endswith(MAGIC) else data),
)
row(
    "ignores-what-is-too-much",
    "6.5/28",
    "Bytes of a file after its counted nodes are ignored.",
    program_file(_cut),
)
row(
    "fills-what-is-missing",
    "6.5/28",
    "Missing bytes of the last node of a file are read as zeros.",
    program_file(_fill),
)


@mutant("runs-nothing-of-damaged-files", "6.5/28")
class RunsEmptyProgram(ControllerCore):
    """A damaged file is run as a program without nodes."""

    def parse_program(self, data: bytes) -> Program:
        return super().parse_program(data) or Program()


@mutant("runs-the-program-before", "6.5/28")
class RunsLastProgram(ControllerCore):
    """The last valid program is run in place of a damaged file."""

    _last: Program | None = None

    def parse_program(self, data: bytes) -> Program | None:
        self._last = super().parse_program(data) or self._last
        return self._last


class _RefusesEqualNeighbours(ControllerCore):
    def parse_program(self, data: bytes) -> Program | None:
        program = super().parse_program(data)
        keys = [variable.key for variable in program.variables] if program else []
        return None if any(a == b for a, b in pairwise(keys)) else program


class _ChecksThreePoints(ControllerCore):
    def parse_program(self, data: bytes) -> Program | None:
        program = super().parse_program(data)
        nodes = parse(data).nodes if program else ()
        for at, node in enumerate(nodes):
            points = [child.type == NodeType.POINT for child in nodes[at + 1 : at + 4]]
            if node.type == NodeType.CURVE_MOVE and not all(points):
                return None
        return program


row(
    "takes-keys-twice",
    "6.5/28",
    "Two variables may have the same key.",
    accepts_errors("P-key-twice"),
)
row(
    "takes-keys-twice-apart",
    "6.5/28",
    "Two variables may have the same key unless they are adjacent.",
    _RefusesEqualNeighbours,
    accepts_errors("P-key-twice"),
    subtle=True,
)
row(
    "takes-short-curves",
    "6.5/28",
    "A curve may have fewer than three points.",
    accepts_errors("P-curve-short", change=straightened),
)
row(
    "takes-other-nodes-in-curves",
    "6.5/28",
    "A curve may contain other nodes than points.",
    accepts_errors("P-curve-child", change=straightened),
)
row(
    "looks-at-three-points-of-acurve",
    "6.5/28",
    "A curve may contain other nodes after its third point.",
    _ChecksThreePoints,
    accepts_errors("P-curve-child", change=straightened),
    subtle=True,
)
row(
    "takes-open-loops",
    "6.5/28",
    "A loop may lack its end, and an end its loop.",
    accepts_errors("P-loop"),
)
row(
    "takes-open-branches",
    "6.5/28",
    "An IF may lack its ENDIF, and an ENDIF its IF.",
    accepts_errors("P-if"),
)
row(
    "takes-stray-else",
    "6.5/28",
    "An ELSE may be anywhere and occur any number of times.",
    accepts_errors("P-else"),
)
