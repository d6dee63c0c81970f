"""Rules for the structure of nodes: moves, loops, IFs (6.5)."""

from collections.abc import Callable, Iterator

from scaraspec.protocol.program_files.model import Node
from scaraspec.protocol.program_files.rules.base import LintContext, LintRule, Problem, Severity
from scaraspec.protocol.program_files.structure import MOVES, CountsMode, Unbalanced, loop_readings
from scaraspec.protocol.program_files.tables import NodeType
from scaraspec.user_message import UserMessage

_COUNTING = MOVES | {NodeType.LOOP}
_MIN_CURVE_POINTS = 3
_FULL_SPEED = 100


def _speed(context: LintContext) -> Iterator[Problem]:
    """The speed of a move is 1 to 100 percent (L922, A-6.5-3)."""
    for index, node in context.nodes(*MOVES):
        if not 1 <= node.speed_rate <= _FULL_SPEED:
            yield Problem(
                UserMessage(
                    "the speed is {speed_rate} %; it must be 1 to 100", speed_rate=node.speed_rate
                ),
                node=index,
            )


def _counts_past_end(context: LintContext) -> Iterator[Problem]:
    """The count of a node does not reach beyond the last node (L924)."""
    for index, node in context.nodes(*_COUNTING):
        if index + node.counts >= len(context.program.nodes):
            yield Problem(
                UserMessage(
                    "its counts = {counts} reaches node {number}, but the last node is {last}",
                    counts=node.counts,
                    number=index + 1 + node.counts,
                    last=len(context.program.nodes),
                ),
                node=index,
            )


def _counts_ignored(context: LintContext) -> Iterator[Problem]:
    """Only moves and loops have a count (L924)."""
    for index, node in enumerate(context.program.nodes):
        # It is open whether an end of loop has a count (A-6.5-4).
        if node.counts and node.type not in _COUNTING | {NodeType.END_LOOP}:
            yield Problem(
                UserMessage(
                    "counts = {counts} has no meaning for a node of type {type}",
                    counts=node.counts,
                    type=node.type,
                ),
                node=index,
            )


def _first_non_point(context: LintContext, index: int, node: Node) -> int | None:
    """Return the first node of a move that is not a point."""
    for child in range(index + 1, min(index + 1 + node.counts, len(context.program.nodes))):
        if context.program.nodes[child].type != NodeType.POINT:
            return child
    return None


def _curve_short(context: LintContext) -> Iterator[Problem]:
    """A curve has at least three points (不能少于 3 个, L942)."""
    for index, node in context.nodes(NodeType.CURVE_MOVE):
        point_count = min(node.counts, len(context.program.nodes) - index - 1)
        if point_count < _MIN_CURVE_POINTS:
            yield Problem(
                UserMessage(
                    "a curve needs at least 3 points, but this one has {point_count}",
                    point_count=point_count,
                ),
                node=index,
            )


def _curve_child(context: LintContext) -> Iterator[Problem]:
    """A curve has only points (只能是结点坐标, L942)."""
    for index, node in context.nodes(NodeType.CURVE_MOVE):
        if (child := _first_non_point(context, index, node)) is not None:
            yield Problem(
                UserMessage(
                    "node {child} belongs to the curve, but its type is {type}, not 1 (a point)",
                    child=child + 1,
                    type=context.program.nodes[child].type,
                ),
                node=index,
            )


def _move_empty(context: LintContext) -> Iterator[Problem]:
    """A straight move has a target point (A-6.5-6)."""
    for index, node in context.nodes(NodeType.STRAIGHT_MOVE):
        if not node.counts:
            yield Problem("the straight move has no target: no node belongs to it", node=index)


def _move_child(context: LintContext) -> Iterator[Problem]:
    """The nodes of a straight move are points (A-6.5-6)."""
    for index, node in context.nodes(NodeType.STRAIGHT_MOVE):
        if (child := _first_non_point(context, index, node)) is not None:
            yield Problem(
                UserMessage(
                    "node {child} belongs to the straight move, but its type is {type}, not 1 "
                    "(a point)",
                    child=child + 1,
                    type=context.program.nodes[child].type,
                ),
                node=index,
            )


def _point_bare(context: LintContext) -> Iterator[Problem]:
    """A point belongs to a move (A-6.5-7)."""
    for index, _ in context.nodes(NodeType.POINT):
        if context.structure.owners[index] is None:
            yield Problem(
                "the point belongs to no move, so the path and the speed are undefined",
                node=index,
            )


def _marker(*kinds: Unbalanced) -> Callable[[LintContext], Iterator[Problem]]:
    def check(context: LintContext) -> Iterator[Problem]:
        """Every marker has its partner (L913-919)."""
        for index, kind in context.structure.unbalanced:
            if kind in kinds:
                yield Problem(UserMessage("this is {error}", error=kind.value), node=index)

    return check


def _common_reading(context: LintContext) -> frozenset[CountsMode]:
    """Return the readings that explain every loop count which any reading explains."""
    readings = loop_readings(context.program.nodes, context.structure).values()
    return frozenset(CountsMode).intersection(*filter(None, readings))


def _loop_counts(context: LintContext) -> Iterator[Problem]:
    """The count of a loop is the number of its nodes; all loops use one reading (A-6.5-4)."""
    common = _common_reading(context)
    for index, modes in loop_readings(context.program.nodes, context.structure).items():
        if not modes:
            records = context.structure.loop_counts[index][CountsMode.RECORDS]
            yield Problem(
                UserMessage(
                    "counts is {counts}, but there are {records} nodes up to the end of the loop; "
                    "the end marker takes precedence",
                    counts=context.program.nodes[index].counts,
                    records=records,
                ),
                node=index,
            )
        elif not common:
            yield Problem(
                UserMessage(
                    "the loop counts its nodes as {modes}, unlike other loops of the program",
                    modes=" or ".join(sorted(modes)),
                ),
                node=index,
            )


def _loop_reading(context: LintContext) -> Iterator[Problem]:
    """The count of a loop includes all nodes before its end (A-6.5-4)."""
    common = _common_reading(context)
    if common and CountsMode.RECORDS not in common:
        yield Problem(
            UserMessage(
                "the loops count their nodes as {common}, the default reading is {records}; "
                "the end markers take precedence",
                common=" or ".join(sorted(common)),
                records=CountsMode.RECORDS,
            ),
            node=min(context.structure.loop_counts),
        )


def _endless_loop(context: LintContext) -> Iterator[Problem]:
    """A program ends (A-6.5-5)."""
    for index in context.structure.loop_counts:
        yield Problem(
            "only an emergency stop ends the loop: the nodes after it are never executed",
            node=index,
        )


FLOW_RULES = (
    LintRule("P-speed", Severity.ERROR, ("6.5/3",), _speed),
    LintRule("P-counts-past-end", Severity.ERROR, ("6.5/5",), _counts_past_end),
    LintRule("P-curve-short", Severity.ERROR, ("6.5/14",), _curve_short),
    LintRule("P-curve-child", Severity.ERROR, ("6.5/14",), _curve_child),
    LintRule(
        "P-loop",
        Severity.ERROR,
        ("6.5/15",),
        _marker(Unbalanced.OPEN_LOOP, Unbalanced.STRAY_END_LOOP),
    ),
    LintRule(
        "P-if",
        Severity.ERROR,
        ("6.5/16",),
        _marker(Unbalanced.OPEN_IF, Unbalanced.STRAY_ENDIF),
    ),
    LintRule(
        "P-else",
        Severity.ERROR,
        ("6.5/16",),
        _marker(Unbalanced.STRAY_ELSE, Unbalanced.SECOND_ELSE),
    ),
    LintRule("P-loop-counts", Severity.WARNING, ("6.5/4",), _loop_counts),
    LintRule("P-move-empty", Severity.WARNING, ("6.5/4",), _move_empty),
    LintRule("P-move-child", Severity.WARNING, ("6.5/4",), _move_child),
    LintRule("P-point-bare", Severity.WARNING, ("6.5/4",), _point_bare),
    LintRule("P-endless-loop", Severity.WARNING, ("6.5/18",), _endless_loop),
    LintRule("P-loop-reading", Severity.INFO, ("6.5/4",), _loop_reading),
    LintRule("P-counts-ignored", Severity.INFO, ("6.5/4",), _counts_ignored),
)
