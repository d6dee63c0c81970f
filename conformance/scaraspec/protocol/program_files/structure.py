"""Structure of a program: which nodes belong to a loop, an IF or a move.

Markers define where a loop or an IF ends. The count of a loop is redundant and is compared with the
expected value. Nodes are identified by index, 0 for the first. The run time is linear in the number
of nodes, whatever the nesting.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, StrEnum

from scaraspec.protocol.program_files.model import Node
from scaraspec.protocol.program_files.tables import NodeType

MOVES = frozenset({NodeType.STRAIGHT_MOVE, NodeType.CURVE_MOVE})
"""The node types whose next `counts` nodes belong to them (L924)."""


class CountsMode(StrEnum):
    """Which nodes the count of a loop includes: the options of reading `counts_mode` (A-6.5-4)."""

    RECORDS = "records"
    """Every node up to its end marker, including nested ones."""
    CHILDREN = "children"
    """Only nodes that are in no nested loop or move; a nested loop includes its end marker."""
    WITH_END = "with-end"
    """Every node, and the end marker."""


class Unbalanced(Enum):
    """Errors of markers (L913-919)."""

    OPEN_LOOP = "a loop without an end"
    STRAY_END_LOOP = "an end of loop without a loop"
    OPEN_IF = "an IF without an ENDIF"
    STRAY_ELSE = "an ELSE that is not directly in an IF"
    SECOND_ELSE = "a second ELSE of the same IF"
    STRAY_ENDIF = "an ENDIF without an IF"


@dataclass(frozen=True, slots=True)
class Structure:
    """The structure of a program. Every tuple has one entry per node.

    Attributes:
        partners: Index of the partner: END_LOOP for LOOP and vice versa; for an IF, its ELSE, or
            its ENDIF if there is no ELSE; ENDIF for ELSE; the ELSE or IF for ENDIF. Else None.
        owners: Index of the innermost move to which the node belongs by the move's `counts`.
        depths: The nesting depth of the node, for a listing.
        loop_counts: For each closed loop, the correct count for each reading.
        unbalanced: Markers without a partner, by index.
    """

    partners: tuple[int | None, ...]
    owners: tuple[int | None, ...]
    depths: tuple[int, ...]
    loop_counts: Mapping[int, Mapping[CountsMode, int]]
    unbalanced: tuple[tuple[int, Unbalanced], ...]

    @classmethod
    def of(cls, nodes: Sequence[Node]) -> "Structure":
        """Return the structure of any nodes; errors are reported in the result, never raised."""
        markers = _Markers(nodes)
        owners = _owners(nodes)
        return cls(
            partners=tuple(markers.partners),
            owners=owners,
            depths=tuple(
                depth + (owner is not None)
                for depth, owner in zip(markers.depths, owners, strict=True)
            ),
            loop_counts=_loop_counts(nodes, markers.partners, owners),
            unbalanced=tuple(sorted(markers.unbalanced, key=lambda item: item[0])),
        )


def loop_readings(nodes: Sequence[Node], structure: Structure) -> dict[int, frozenset[CountsMode]]:
    """Return for each closed loop the readings for which its count is correct (A-6.5-4)."""
    return {
        index: frozenset(mode for mode in CountsMode if counts[mode] == nodes[index].counts)
        for index, counts in structure.loop_counts.items()
    }


@dataclass(slots=True)
class _Scope:
    """An open loop, or an open IF with its last marker so far."""

    first: int
    last: int


class _Markers:
    """Matches markers in one pass. A closing marker also closes the open markers inside it."""

    def __init__(self, nodes: Sequence[Node]) -> None:
        self.partners: list[int | None] = [None] * len(nodes)
        self.depths: list[int] = []
        self.unbalanced: list[tuple[int, Unbalanced]] = []
        self._loops: int = 0
        self._ifs: int = 0
        self._open: list[_Scope] = []
        self._nodes = nodes
        for index, node in enumerate(nodes):
            depth = len(self._open)
            match node.type:
                case NodeType.LOOP:
                    self._loops += 1
                    self._open.append(_Scope(index, index))
                case NodeType.IF:
                    self._ifs += 1
                    self._open.append(_Scope(index, index))
                case NodeType.ELSE:
                    depth = self._else(index)
                case NodeType.END_LOOP:
                    depth = self._close(index, self._loops, Unbalanced.STRAY_END_LOOP)
                case NodeType.ENDIF:
                    depth = self._close(index, self._ifs, Unbalanced.STRAY_ENDIF)
            self.depths.append(depth)
        while self._open:
            self._pop_unclosed()

    def _is_loop(self, scope: _Scope) -> bool:
        return self._nodes[scope.first].type == NodeType.LOOP

    def _else(self, index: int) -> int:
        if not self._open or self._is_loop(self._open[-1]):
            self.unbalanced.append((index, Unbalanced.STRAY_ELSE))
            return len(self._open)
        scope = self._open[-1]
        if scope.first != scope.last:
            self.unbalanced.append((index, Unbalanced.SECOND_ELSE))
        else:
            self.partners[scope.last] = index
            scope.last = index
        return len(self._open) - 1

    def _close(self, index: int, open_count: int, stray: Unbalanced) -> int:
        if not open_count:
            self.unbalanced.append((index, stray))
            return len(self._open)
        closes_loop = stray is Unbalanced.STRAY_END_LOOP
        while self._is_loop(self._open[-1]) != closes_loop:
            self._pop_unclosed()
        last = self._pop().last
        self.partners[last], self.partners[index] = index, last
        return len(self._open)

    def _pop(self) -> _Scope:
        scope = self._open.pop()
        if self._is_loop(scope):
            self._loops -= 1
        else:
            self._ifs -= 1
        return scope

    def _pop_unclosed(self) -> None:
        scope = self._pop()
        what = Unbalanced.OPEN_LOOP if self._is_loop(scope) else Unbalanced.OPEN_IF
        self.unbalanced.append((scope.first, what))


def _owners(nodes: Sequence[Node]) -> tuple[int | None, ...]:
    owners: list[int | None] = []
    moves: list[int] = []
    for index, node in enumerate(nodes):
        while moves and index > moves[-1] + nodes[moves[-1]].counts:
            moves.pop()
        owners.append(moves[-1] if moves else None)
        if node.type in MOVES:
            moves.append(index)
    return tuple(owners)


def _loop_counts(
    nodes: Sequence[Node], partners: Sequence[int | None], owners: Sequence[int | None]
) -> dict[int, dict[CountsMode, int]]:
    counts: dict[int, dict[CountsMode, int]] = {}
    loops: list[int] = []
    for index, node in enumerate(nodes):
        end = partners[index]
        if node.type == NodeType.END_LOOP:
            if end is not None:
                loops.pop()
            continue
        owner = owners[index]
        if loops and (owner is None or owner < loops[-1]):
            counts[loops[-1]][CountsMode.CHILDREN] += 1
        if node.type == NodeType.LOOP and end is not None:
            counts[index] = {
                CountsMode.RECORDS: end - index - 1,
                CountsMode.CHILDREN: 0,
                CountsMode.WITH_END: end - index,
            }
            loops.append(index)
    return counts
