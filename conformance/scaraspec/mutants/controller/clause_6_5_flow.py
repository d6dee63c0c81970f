"""Mutants of clause 6.5: which nodes are executed, in which order, and the outputs they set."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.programs import with_interpreter
from scaraspec.protocol.payloads import Outcome
from scaraspec.protocol.program_files import Node, NodeType, Operation, SetOutput
from scaraspec.virtual_controller.interpreter import Run

# ---------------------------------------------------------------------- every node


def _ends_after(nodes: int) -> Core:
    """A program ends after this number of nodes."""

    class EndsAfter(Run):
        def _step(self, now_s: float) -> None:
            if self._index == nodes:
                self._index = len(self._program.nodes)
            super()._step(now_s)

    return with_interpreter(EndsAfter)


@mutant("skips-the-last-node", "6.5/26")
class SkipsLastNode(Run):
    """The last node of a program is not executed."""

    def _step(self, now_s: float) -> None:
        self._index += self._index == len(self._program.nodes) - 1
        super()._step(now_s)


@mutant("skips-the-first-node", "6.5/26")
class SkipsFirstNode(Run):
    """The first node of a program is not executed."""

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        self._index = 1


row(
    "counts-nodes-in-one-byte",
    "6.5/26",
    "A program ends after 255 nodes.",
    _ends_after(255),
    subtle=True,
)
row(
    "holds-three-hundred-nodes",
    "6.5/26",
    "A program ends after 300 nodes.",
    _ends_after(300),
    subtle=True,
)


@mutant("loses-the-last-node-of-each-page", "6.5/26", subtle=True)
class SkipsEach256thNode(Run):
    """Every 256th node is not executed."""

    def _step(self, now_s: float) -> None:
        self._index += self._index % 256 == 255
        super()._step(now_s)


@mutant("calculates-nothing-behind-waits", "6.5/26", subtle=True)
class SkipsCalculationAfterWait(Run):
    """A calculation directly after a wait is not executed."""

    def _step(self, now_s: float) -> None:
        types = [node.type for node in self._program.nodes[: self._index + 1]]
        self._index += types[-2:] == [NodeType.WAIT_SECONDS, NodeType.COMPUTE]
        super()._step(now_s)


@mutant("ends-at-an-endif", "6.5/26", "6.5/24")
class EndsAtEndif(Run):
    """A program ends at its first ENDIF."""

    def _begin(self, node: Node, now_s: float) -> float:
        if node.type == NodeType.ENDIF:
            self._index = len(self._program.nodes)
        return super()._begin(node, now_s)


# ---------------------------------------------------------------------- outputs


def _output(change: Callable[[SetOutput], SetOutput | None]) -> Core:
    """The output nodes are changed; for None the node has no effect."""

    class ChangedOutput(Run):
        def _set_output(self, output: SetOutput) -> None:
            changed = change(output)
            if changed is not None:
                super()._set_output(changed)

    return with_interpreter(ChangedOutput)


row(
    "output-nodes-only-switch-on",
    "6.5/19",
    "An output node sets its port to 1 but never to 0.",
    _output(lambda output: output if output.value else None),
)
row(
    "output-nodes-from-zero",
    "6.5/19",
    "An output node sets the port with the next number.",
    _output(lambda output: replace(output, port=output.port % 16 + 1)),
)
row(
    "output-nodes-invert",
    "6.5/19",
    "An output node sets its port to the opposite of its value.",
    _output(lambda output: replace(output, value=int(not output.value))),
)


@mutant("output-nodes-clear-the-others", "6.5/19")
class ClearsOtherOutputs(Run):
    """An output node sets every other output to 0."""

    def _set_output(self, output: SetOutput) -> None:
        for port, _ in enumerate(self._plant.digital_outputs, start=1):
            self._set(self._plant.digital_outputs, port, value=False)
        super()._set_output(output)


row(
    "output-nodes-forget-the-highest-port",
    "6.5/19",
    "An output node of port 16 has no effect.",
    _output(lambda output: output if output.port < 16 else None),
    subtle=True,
)


@mutant("outputs-at-the-start", "6.5/19")
class SetsOutputsAtStart(Run):
    """A program also sets all its outputs at its start."""

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        for node in self._program.nodes:
            if isinstance(node.data, SetOutput):
                self._set_output(node.data)


@mutant("outputs-at-the-end", "6.5/19")
class SetsOutputsAtEnd(Run):
    """A program sets its outputs only at its end."""

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        self._due: list[SetOutput] = []

    def _set_output(self, output: SetOutput) -> None:
        self._due.append(output)

    def _end(self, outcome: Outcome) -> None:
        for output in self._due:
            super()._set_output(output)
        super()._end(outcome)


@mutant("outputs-go-off-at-the-end", "6.5/19")
class ClearsOutputsAtEnd(Run):
    """The outputs that a program sets become 0 at its end."""

    def _end(self, outcome: Outcome) -> None:
        for node in self._program.nodes:
            if isinstance(node.data, SetOutput):
                self._set(self._plant.digital_outputs, node.data.port, value=False)
        super()._end(outcome)


# ---------------------------------------------------------------------- loops and branches


@mutant("loops-once", "6.5/23")
class IgnoresEndOfLoop(Run):
    """The nodes of a loop are executed once."""

    def _repeat(self, start: int) -> None: ...


@mutant("loops-without-their-first-node", "6.5/23")
class RepeatsFromSecondNode(Run):
    """A repeated loop continues with its second node."""

    def _repeat(self, start: int) -> None:
        self._index = start + 1


@mutant("loops-of-their-last-node", "6.5/23")
class RepeatsLastNode(Run):
    """A loop repeats only its last node."""

    def _repeat(self, start: int) -> None:
        self._index = max(start, self._index - 2)


@mutant("loops-fall-into-else", "6.5/23", subtle=True)
class IgnoresElseInLoop(Run):
    """In a loop both branches of an IF are executed when its comparison holds."""

    def _begin_marker(self, node: Node, now_s: float) -> float:
        types = [each.type for each in self._program.nodes[: self._index]]
        in_loop = types.count(NodeType.LOOP) > types.count(NodeType.END_LOOP)
        ignored = in_loop and node.type == NodeType.ELSE
        return now_s if ignored else super()._begin_marker(node, now_s)


@mutant("waits-half-in-loops", "6.5/20", subtle=True)
class HalvesWaitsInLoop(Run):
    """A wait in a loop takes half of its time."""

    def _begin(self, node: Node, now_s: float) -> float:
        ends_s = super()._begin(node, now_s)
        loops = any(each.type == NodeType.LOOP for each in self._program.nodes[: self._index])
        return (ends_s + now_s) / 2 if loops and node.type == NodeType.WAIT_SECONDS else ends_s


@mutant("loops-fail-the-second-time", "6.5/23", subtle=True)
class FailsAtEndOfLoop(Run):
    """A program fails when a loop is repeated."""

    def _begin(self, node: Node, now_s: float) -> float:
        if node.type == NodeType.END_LOOP:
            raise ZeroDivisionError
        return super()._begin(node, now_s)


@mutant("both-branches", "6.5/24")
class IgnoresElse(Run):
    """The second branch is executed after the first one."""

    def _begin_marker(self, node: Node, now_s: float) -> float:
        return now_s if node.type == NodeType.ELSE else super()._begin_marker(node, now_s)


@mutant("no-second-branch", "6.5/24")
class SkipsElse(Run):
    """No branch is executed when the comparison does not hold."""

    def _begin(self, node: Node, now_s: float) -> float:
        ends_s = super()._begin(node, now_s)
        if node.type == NodeType.IF and self._program.nodes[self._index].type == NodeType.ELSE:
            self._index = self._partner()
        return ends_s


@mutant("always-first-branch-without-else", "6.5/24")
class IgnoresComparisonWithoutElse(Run):
    """The branch of an IF without ELSE is executed even if its comparison does not hold."""

    def _holds(self, operation: Operation) -> bool:
        partner = self._program.nodes[self._partner()]
        return partner.type == NodeType.ENDIF or super()._holds(operation)


@mutant("nested-branches-uncounted", "6.5/24", subtle=True)
class JumpsToNextElse(Run):
    """After a comparison that does not hold, the next ELSE or ENDIF of any IF is executed."""

    def _partner(self) -> int:
        partner = super()._partner()
        if self._program.nodes[self._index].type not in (NodeType.IF, NodeType.ELSE):
            return partner
        stops = (NodeType.ELSE, NodeType.ENDIF)
        after = range(self._index + 1, partner + 1)
        return next(at for at in after if self._program.nodes[at].type in stops)
