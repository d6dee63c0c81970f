"""Faults of clause 6.5: which nodes are executed, in which order, and the outputs that they set."""

from dataclasses import replace
from typing import Any, ClassVar

from scaraspec.mutants.operators.controller.programs import misrun
from scaraspec.protocol.payloads import Outcome
from scaraspec.protocol.program_files import (
    Node,
    NodeType,
    Operation,
    SetOutput,
)
from scaraspec.virtual_controller.interpreter import Run

# ---------------------------------------------------------------------- every node


@misrun("skips-the-last-node", "6.5/26")
class SkipsTheLastNode(Run):
    """The last node of a program is not executed."""

    def _step(self, now_s: float) -> None:
        if self._index == len(self._program.nodes) - 1:
            self._index += 1
        super()._step(now_s)


@misrun("skips-the-first-node", "6.5/26")
class SkipsTheFirstNode(Run):
    """The first node of a program is not executed."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._index = 1


@misrun("counts-nodes-in-one-byte", "6.5/26", subtle=True)
class CountsNodesInOneByte(Run):
    """A program is over after 255 nodes."""

    most: ClassVar[int] = 0xFF

    def _step(self, now_s: float) -> None:
        if self._index == self.most:
            self._index = len(self._program.nodes)
        super()._step(now_s)


@misrun("holds-three-hundred-nodes", "6.5/26", subtle=True)
class HoldsThreeHundredNodes(CountsNodesInOneByte):
    """A program is over after 300 nodes."""

    most = 300


@misrun("loses-the-last-node-of-each-page", "6.5/26", subtle=True)
class LosesTheLastNodeOfEachPage(Run):
    """Every 256th node is not executed."""

    def _step(self, now_s: float) -> None:
        self._index += self._index % 256 == 255
        super()._step(now_s)


@misrun("calculates-nothing-behind-waits", "6.5/26", subtle=True)
class CalculatesNothingBehindWaits(Run):
    """A calculation directly behind a wait is not executed."""

    def _step(self, now_s: float) -> None:
        types = [node.type for node in self._program.nodes[: self._index + 1]]
        if types[-2:] == [NodeType.WAIT_SECONDS, NodeType.COMPUTE]:
            self._index += 1
        super()._step(now_s)


@misrun("ends-at-an-endif", "6.5/26", "6.5/24")
class EndsAtAnEndif(Run):
    """A program is over at its first ENDIF."""

    def _begin(self, node: Node, now_s: float) -> float:
        if node.type == NodeType.ENDIF:
            self._index = len(self._program.nodes)
        return super()._begin(node, now_s)


# ---------------------------------------------------------------------- outputs


@misrun("output-nodes-only-switch-on", "6.5/19")
class OutputNodesOnlySwitchOn(Run):
    """An output node sets its port to 1 and never to 0."""

    def _set_output(self, output: SetOutput) -> None:
        if output.value:
            super()._set_output(output)


@misrun("output-nodes-from-zero", "6.5/19")
class OutputNodesFromZero(Run):
    """An output node sets the port above its own."""

    def _set_output(self, output: SetOutput) -> None:
        super()._set_output(replace(output, port=output.port % 16 + 1))


@misrun("output-nodes-invert", "6.5/19")
class OutputNodesInvert(Run):
    """An output node sets its port to the opposite of its value."""

    def _set_output(self, output: SetOutput) -> None:
        super()._set_output(replace(output, value=int(not output.value)))


@misrun("output-nodes-clear-the-others", "6.5/19")
class OutputNodesClearTheOthers(Run):
    """An output node sets every other output to 0."""

    def _set_output(self, output: SetOutput) -> None:
        for port, _ in enumerate(self._plant.digital_outputs, start=1):
            self._set(self._plant.digital_outputs, port, value=False)
        super()._set_output(output)


@misrun("output-nodes-forget-the-highest-port", "6.5/19", subtle=True)
class OutputNodesForgetTheHighestPort(Run):
    """An output node of port 16 has no effect."""

    def _set_output(self, output: SetOutput) -> None:
        if output.port < 16:
            super()._set_output(output)


@misrun("outputs-at-the-start", "6.5/19")
class OutputsAtTheStart(Run):
    """A program sets all its outputs at its start already."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        for node in self._program.nodes:
            if isinstance(node.data, SetOutput):
                self._set_output(node.data)


@misrun("outputs-at-the-end", "6.5/19")
class OutputsAtTheEnd(Run):
    """A program sets its outputs only when it ends."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._due: list[SetOutput] = []

    def _set_output(self, output: SetOutput) -> None:
        self._due.append(output)

    def _end(self, outcome: Outcome) -> None:
        for output in self._due:
            super()._set_output(output)
        super()._end(outcome)


@misrun("outputs-go-off-at-the-end", "6.5/19")
class OutputsGoOffAtTheEnd(Run):
    """What a program has switched on goes off when it ends."""

    def _end(self, outcome: Outcome) -> None:
        for node in self._program.nodes:
            if isinstance(node.data, SetOutput):
                self._set(self._plant.digital_outputs, node.data.port, value=False)
        super()._end(outcome)


# ---------------------------------------------------------------------- loops and branches


@misrun("loops-once", "6.5/23")
class LoopsOnce(Run):
    """The nodes of a loop are executed once."""

    def _repeat(self, start: int) -> None:
        pass


@misrun("loops-without-their-first-node", "6.5/23")
class LoopsWithoutTheirFirstNode(Run):
    """A loop begins with its second node when it comes again."""

    def _repeat(self, start: int) -> None:
        self._index = start + 1


@misrun("loops-of-their-last-node", "6.5/23")
class LoopsOfTheirLastNode(Run):
    """A loop repeats nothing but its last node."""

    def _repeat(self, start: int) -> None:
        self._index = max(start, self._index - 2)


@misrun("loops-fall-into-else", "6.5/23", subtle=True)
class LoopsFallIntoElse(Run):
    """Within a loop both branches of an IF that holds are executed."""

    def _begin_marker(self, node: Node, now_s: float) -> float:
        ahead = [each.type for each in self._program.nodes[: self._index]]
        loops = ahead.count(NodeType.LOOP) > ahead.count(NodeType.END_LOOP)
        both = loops and node.type == NodeType.ELSE
        return now_s if both else super()._begin_marker(node, now_s)


@misrun("waits-half-in-loops", "6.5/20", subtle=True)
class WaitsHalfInLoops(Run):
    """A wait within a loop lasts half as long as it should."""

    def _begin(self, node: Node, now_s: float) -> float:
        ends_s = super()._begin(node, now_s)
        loops = any(each.type == NodeType.LOOP for each in self._program.nodes[: self._index])
        return (ends_s + now_s) / 2 if loops and node.type == NodeType.WAIT_SECONDS else ends_s


@misrun("loops-fail-the-second-time", "6.5/23", subtle=True)
class LoopsFailTheSecondTime(Run):
    """A program fails when a loop is to come again."""

    def _begin(self, node: Node, now_s: float) -> float:
        if node.type == NodeType.END_LOOP:
            raise ZeroDivisionError
        return super()._begin(node, now_s)


@misrun("both-branches", "6.5/24")
class BothBranches(Run):
    """After the first branch the second one is executed too."""

    def _begin_marker(self, node: Node, now_s: float) -> float:
        return now_s if node.type == NodeType.ELSE else super()._begin_marker(node, now_s)


@misrun("no-second-branch", "6.5/24")
class NoSecondBranch(Run):
    """Where a comparison does not hold, the ELSE is passed over too."""

    def _begin(self, node: Node, now_s: float) -> float:
        end_s = super()._begin(node, now_s)
        if node.type == NodeType.IF and self._program.nodes[self._index].type == NodeType.ELSE:
            self._index = self._partner()
        return end_s


@misrun("always-first-branch-without-else", "6.5/24")
class AlwaysFirstBranchWithoutElse(Run):
    """An IF without ELSE is executed whether its comparison holds or not."""

    def _holds(self, operation: Operation) -> bool:
        partner = self._program.nodes[self._partner()]
        return partner.type == NodeType.ENDIF or super()._holds(operation)


@misrun("nested-branches-uncounted", "6.5/24", subtle=True)
class NestedBranchesUncounted(Run):
    """Where a comparison does not hold, the program goes on at the next ELSE or ENDIF of any IF."""

    def _partner(self) -> int:
        partner = super()._partner()
        here = self._program.nodes[self._index].type
        if here not in (NodeType.IF, NodeType.ELSE):
            return partner
        stops = (NodeType.ELSE, NodeType.ENDIF)
        after = range(self._index + 1, partner + 1)
        return next(at for at in after if self._program.nodes[at].type in stops)
