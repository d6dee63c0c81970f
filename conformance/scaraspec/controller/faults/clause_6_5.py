"""Faults of clause 6.5: what nodes of programs do, and which of them are executed."""

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, ClassVar

from scaraspec.controller.arm import Joints
from scaraspec.controller.faults.interpreting import misrun
from scaraspec.controller.interpreter import Run
from scaraspec.controller.motion import Motion, curve, hold, move
from scaraspec.protocol.payloads import Outcome
from scaraspec.protocol.programs import (
    Condition,
    Node,
    NodeType,
    Operation,
    Point,
    SetOutput,
    WaitInput,
    WaitSeconds,
    WaitTimer,
)

_PATIENCE_S = 0.4

# ---------------------------------------------------------------------- every node


@misrun("6.5/26")
class SkipsTheLastNode(Run):
    """The last node of a program is not executed."""

    def _step(self, now_s: float) -> None:
        if self._index == len(self._program.nodes) - 1:
            self._index += 1
        super()._step(now_s)


@misrun("6.5/26")
class SkipsTheFirstNode(Run):
    """The first node of a program is not executed."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._index = 1


@misrun("6.5/26", subtle=True)
class CountsNodesInOneByte(Run):
    """A program is over after 255 nodes."""

    most: ClassVar[int] = 0xFF

    def _step(self, now_s: float) -> None:
        if self._index == self.most:
            self._index = len(self._program.nodes)
        super()._step(now_s)


@misrun("6.5/26", subtle=True)
class HoldsThreeHundredNodes(CountsNodesInOneByte):
    """A program is over after 300 nodes."""

    most = 300


@misrun("6.5/26", "6.5/24")
class EndsAtAnEndif(Run):
    """A program is over at its first ENDIF."""

    def _begin(self, node: Node, now_s: float) -> float:
        if node.type == NodeType.ENDIF:
            self._index = len(self._program.nodes)
        return super()._begin(node, now_s)


@misrun("6.5/27", subtle=True)
class LeavesOutTheEndOfLongCurves(Run):
    """A curve of more than four points ends at the last but one."""

    def _curve(self, node: Node) -> Motion:
        if node.counts <= 4:
            return super()._curve(node)
        motion = super()._curve(replace(node, counts=node.counts - 1))
        self._index += 1
        return motion


# ---------------------------------------------------------------------- outputs


@misrun("6.5/19")
class OutputNodesOnlySwitchOn(Run):
    """An output node sets its port to 1 and never to 0."""

    def _set_output(self, output: SetOutput) -> None:
        if output.value:
            super()._set_output(output)


@misrun("6.5/19")
class OutputNodesFromZero(Run):
    """An output node sets the port above its own."""

    def _set_output(self, output: SetOutput) -> None:
        super()._set_output(replace(output, port=output.port % 16 + 1))


@misrun("6.5/19")
class OutputNodesInvert(Run):
    """An output node sets its port to the opposite of its value."""

    def _set_output(self, output: SetOutput) -> None:
        super()._set_output(replace(output, value=int(not output.value)))


@misrun("6.5/19")
class OutputNodesClearTheOthers(Run):
    """An output node sets every other output to 0."""

    def _set_output(self, output: SetOutput) -> None:
        for port, _ in enumerate(self._plant.digital_outputs, start=1):
            self._set(self._plant.digital_outputs, port, value=False)
        super()._set_output(output)


@misrun("6.5/19", subtle=True)
class OutputNodesForgetTheHighestPort(Run):
    """An output node of port 16 has no effect."""

    def _set_output(self, output: SetOutput) -> None:
        if output.port < 16:
            super()._set_output(output)


@misrun("6.5/19")
class OutputsAtTheStart(Run):
    """A program sets all its outputs at its start already."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        for node in self._program.nodes:
            if isinstance(node.data, SetOutput):
                self._set_output(node.data)


@misrun("6.5/19")
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


@misrun("6.5/19")
class OutputsGoOffAtTheEnd(Run):
    """What a program has switched on goes off when it ends."""

    def _end(self, outcome: Outcome) -> None:
        for node in self._program.nodes:
            if isinstance(node.data, SetOutput):
                self._set(self._plant.digital_outputs, node.data.port, value=False)
        super()._end(outcome)


# ---------------------------------------------------------------------- waits


class _Waits(Run):
    """Waits for another time than the seconds of the node."""

    def lasts_s(self, duration_s: float) -> float:
        """For how long it waits."""
        return duration_s

    def _begin(self, node: Node, now_s: float) -> float:
        if isinstance(node.data, WaitSeconds):
            return now_s + self.lasts_s(node.data.duration_s)
        return super()._begin(node, now_s)


@misrun("6.5/20")
class WaitsMilliseconds(_Waits):
    """A wait takes thousandths of its seconds."""

    def lasts_s(self, duration_s: float) -> float:
        """Divide them."""
        return duration_s / 1000


@misrun("6.5/20")
class WaitsOneFifthLonger(_Waits):
    """A wait takes a fifth longer than its seconds."""

    def lasts_s(self, duration_s: float) -> float:
        """Stretch them."""
        return duration_s * 1.2


@misrun("6.5/20")
class WaitsOneSecondMore(_Waits):
    """A wait takes a second more than it should, as when ticks are counted from 0."""

    def lasts_s(self, duration_s: float) -> float:
        """Add it."""
        return duration_s + 1


@misrun("6.5/20", subtle=True)
class WaitsSlightlyLess(_Waits):
    """A wait is over a twentieth of a second early."""

    def lasts_s(self, duration_s: float) -> float:
        """Take it away."""
        return max(duration_s - 0.05, 0)


@misrun("6.5/20", subtle=True)
class WaitsSignedBytes(_Waits):
    """A wait of 128 seconds or more is over at once, as its byte is taken for a negative one."""

    def lasts_s(self, duration_s: float) -> float:
        """Take the highest bit for a sign."""
        return duration_s if duration_s < 0x80 else 0


@misrun("6.5/20", subtle=True)
class WaitsTheSecondTimeForNothing(_Waits):
    """Only the first two waits of a program take time."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._waits = 0

    def lasts_s(self, duration_s: float) -> float:
        """Count them."""
        self._waits += 1
        return duration_s if self._waits <= 2 else 0


@misrun("6.5/20")
class WaitsAtLeastOneSecond(_Waits):
    """A wait of 0 seconds takes one."""

    def lasts_s(self, duration_s: float) -> float:
        """Lengthen it."""
        return max(duration_s, 1)


@misrun("6.5/22")
class TimersArePassed(Run):
    """A timer does not hold the program."""

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        return now_s if isinstance(wait, WaitTimer) else super()._wait_ends_s(wait, now_s)


class _Timers(Run):
    """Takes the instant of a timer for another one."""

    def due(self, timer: WaitTimer) -> WaitTimer:
        """The instant that it waits for."""
        return timer

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        return super()._wait_ends_s(self.due(wait) if isinstance(wait, WaitTimer) else wait, now_s)


@misrun("6.5/22")
class TimersOfWholeSeconds(_Timers):
    """The microseconds of a timer are left out."""

    def due(self, timer: WaitTimer) -> WaitTimer:
        """Leave them out."""
        return replace(timer, microseconds=0)


@misrun("6.5/22")
class TimersOneSecondLate(_Timers):
    """A timer is over a second after its instant."""

    def due(self, timer: WaitTimer) -> WaitTimer:
        """Add it."""
        return replace(timer, seconds=timer.seconds + 1)


@misrun("6.5/22")
class TimersOfAnotherZone(_Timers):
    """A timer goes by Chinese time, eight hours ahead."""

    def due(self, timer: WaitTimer) -> WaitTimer:
        """Come earlier."""
        return replace(timer, seconds=timer.seconds - 8 * 3600)


@misrun("6.5/22")
class TimersAreDurations(_Timers):
    """A timer waits for its seconds from now on."""

    def due(self, timer: WaitTimer) -> WaitTimer:
        """Double them."""
        return replace(timer, seconds=2 * timer.seconds)


# ---------------------------------------------------------------------- inputs


class _Conditions(Run):
    """Waits for something else of an input."""

    def meant(self, wait: WaitInput) -> WaitInput:
        """What it waits for."""
        return wait

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        return super()._wait_ends_s(
            self.meant(wait) if isinstance(wait, WaitInput) else wait, now_s
        )


class _OtherConditions(_Conditions):
    """Takes conditions for others."""

    others: ClassVar[Mapping[int, Condition]]

    def meant(self, wait: WaitInput) -> WaitInput:
        """With the other condition."""
        return replace(wait, condition=self.others.get(wait.condition, wait.condition))


@misrun("6.5/9")
class ConditionsAsOperators(_OtherConditions):
    """Conditions 4 and 5 have each other's meaning, in the order of the operators 8 and 9."""

    others = MappingProxyType(
        {Condition.NOT_GREATER: Condition.NOT_LESS, Condition.NOT_LESS: Condition.NOT_GREATER}
    )


@misrun("6.5/9", subtle=True)
class GreaterOnTheEdge(_OtherConditions):
    """Condition 1 holds on its edge too."""

    others = MappingProxyType({Condition.GREATER: Condition.NOT_LESS})


@misrun("6.5/9", subtle=True)
class LessOnTheEdge(_OtherConditions):
    """Condition 2 holds on its edge too."""

    others = MappingProxyType({Condition.LESS: Condition.NOT_GREATER})


@misrun("6.5/9", subtle=True)
class EqualBelowTheEdge(_OtherConditions):
    """Condition 3 holds below its edge too."""

    others = MappingProxyType({Condition.EQUAL: Condition.NOT_GREATER})


@misrun("6.5/9", subtle=True)
class NotGreaterOffTheEdge(_OtherConditions):
    """Condition 4 does not hold on its edge."""

    others = MappingProxyType({Condition.NOT_GREATER: Condition.LESS})


@misrun("6.5/9", subtle=True)
class NotLessOffTheEdge(_OtherConditions):
    """Condition 5 does not hold on its edge."""

    others = MappingProxyType({Condition.NOT_LESS: Condition.GREATER})


@misrun("6.5/9")
class ComparesTheValueWithTheInput(_OtherConditions):
    """The value stands on the left of the condition and the input on the right."""

    others = MappingProxyType(
        {
            Condition.GREATER: Condition.LESS,
            Condition.LESS: Condition.GREATER,
            Condition.NOT_GREATER: Condition.NOT_LESS,
            Condition.NOT_LESS: Condition.NOT_GREATER,
        }
    )


@misrun("6.5/9", subtle=True)
class ComparesWholes(_Conditions):
    """What is less than one is left out of the value that an input is compared with."""

    def meant(self, wait: WaitInput) -> WaitInput:
        """With a whole value; a digital 1 may be stored as 1."""
        whole = wait.value_hundredths // 100 * 100 or wait.value_hundredths % 2
        return replace(wait, value_hundredths=whole)


@misrun("6.5/9")
class AnalogInputsUnscaled(Run):
    """Analog inputs are compared as they are and not in hundredths."""

    def _input(self, port: int) -> int:
        value = super()._input(port)
        return value // 100 if self._is_analog(port) else value


@misrun("6.5/9")
class DigitalInputsOfAllOnes(Run):
    """A digital input that is on counts 255."""

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        if isinstance(wait, WaitInput) and not self._is_analog(wait.port):
            state = 0xFF * self._input(wait.port)
            holds = Condition(wait.condition).holds(state, wait.value_hundredths)
            return now_s if holds else math.inf
        return super()._wait_ends_s(wait, now_s)


@misrun("6.5/21", "6.5/9")
class InputsArePassed(_Conditions):
    """A program does not wait for inputs."""

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        return now_s if isinstance(wait, WaitInput) else super()._wait_ends_s(wait, now_s)


@misrun("6.5/21")
class InputsAreLookedAtOnce(_Conditions):
    """An input that does not meet its condition at first is never looked at again."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._failed_at: set[int] = set()

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        ends_s = super()._wait_ends_s(wait, now_s)
        if ends_s == math.inf:
            self._failed_at.add(id(wait))
        return math.inf if id(wait) in self._failed_at else ends_s


@misrun("6.5/21", subtle=True)
class InputsTimeOut(_Conditions):
    """A wait for an input is given up after less than half a second."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._begun_s: dict[int, float] = {}

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        ends_s = super()._wait_ends_s(wait, now_s)
        if isinstance(wait, WaitTimer):
            return ends_s
        return min(ends_s, self._begun_s.setdefault(id(wait), now_s) + _PATIENCE_S)


@misrun("6.5/21")
class WaitsForThePortAbove(_Conditions):
    """A program waits for the input above the one that its node names."""

    def meant(self, wait: WaitInput) -> WaitInput:
        """Go one on, but for analog inputs."""
        return wait if self._is_analog(wait.port) else replace(wait, port=wait.port % 7 + 1)


@misrun("6.5/21")
class WaitsForAnyInput(_Conditions):
    """A wait for an input ends as soon as any input meets the condition."""

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        if isinstance(wait, WaitTimer) or self._is_analog(wait.port):
            return super()._wait_ends_s(wait, now_s)
        ports = range(1, 7)
        return min(
            super(type(self), self)._wait_ends_s(replace(wait, port=p), now_s) for p in ports
        )


@misrun("6.5/21")
class EndsAfterAnInput(_Conditions):
    """A program that has waited for an input ends when it comes, with what follows undone."""

    def _step(self, now_s: float) -> None:
        if isinstance(self._wait, WaitInput):
            self._index = len(self._program.nodes)
        super()._step(now_s)


# ---------------------------------------------------------------------- loops and branches


@misrun("6.5/23")
class LoopsOnce(Run):
    """The nodes of a loop are executed once."""

    def _repeat(self, start: int) -> None:
        pass


@misrun("6.5/23")
class LoopsWithoutTheirFirstNode(Run):
    """A loop begins with its second node when it comes again."""

    def _repeat(self, start: int) -> None:
        self._index = start + 1


@misrun("6.5/23")
class LoopsOfTheirLastNode(Run):
    """A loop repeats nothing but its last node."""

    def _repeat(self, start: int) -> None:
        self._index = max(start, self._index - 2)


@misrun("6.5/23", subtle=True)
class LoopsFallIntoElse(Run):
    """Within a loop both branches of an IF that holds are executed."""

    def _begin_marker(self, node: Node, now_s: float) -> float:
        ahead = [each.type for each in self._program.nodes[: self._index]]
        loops = ahead.count(NodeType.LOOP) > ahead.count(NodeType.END_LOOP)
        both = loops and node.type == NodeType.ELSE
        return now_s if both else super()._begin_marker(node, now_s)


@misrun("6.5/20", subtle=True)
class WaitsHalfInLoops(Run):
    """A wait within a loop lasts half as long as it should."""

    def _begin(self, node: Node, now_s: float) -> float:
        ends_s = super()._begin(node, now_s)
        loops = any(each.type == NodeType.LOOP for each in self._program.nodes[: self._index])
        return (ends_s + now_s) / 2 if loops and node.type == NodeType.WAIT_SECONDS else ends_s


@misrun("6.5/23", subtle=True)
class LoopsFailTheSecondTime(Run):
    """A program fails when a loop is to come again."""

    def _begin(self, node: Node, now_s: float) -> float:
        if node.type == NodeType.END_LOOP:
            raise ZeroDivisionError
        return super()._begin(node, now_s)


@misrun("6.5/24")
class BothBranches(Run):
    """After the first branch the second one is executed too."""

    def _begin_marker(self, node: Node, now_s: float) -> float:
        return now_s if node.type == NodeType.ELSE else super()._begin_marker(node, now_s)


@misrun("6.5/24")
class NoSecondBranch(Run):
    """Where a comparison does not hold, the ELSE is passed over too."""

    def _begin(self, node: Node, now_s: float) -> float:
        end_s = super()._begin(node, now_s)
        if node.type == NodeType.IF and self._program.nodes[self._index].type == NodeType.ELSE:
            self._index = self._partner()
        return end_s


@misrun("6.5/24")
class AlwaysFirstBranchWithoutElse(Run):
    """An IF without ELSE is executed whether its comparison holds or not."""

    def _holds(self, operation: Operation) -> bool:
        partner = self._program.nodes[self._partner()]
        return partner.type == NodeType.ENDIF or super()._holds(operation)


@misrun("6.5/24", subtle=True)
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


# ---------------------------------------------------------------------- moves and points


class _StaysAt(Run):
    """Does not go to some of the points of a straight move."""

    def stays(self, place: int, count: int) -> bool:
        """Whether it passes over the point of this place, 0 for the first, of so many."""
        return place == count

    def _motion_to(self, point: Point) -> Motion:
        owner = self._structure.owners[self._index]
        if owner is not None:
            count = self._program.nodes[owner].counts
            if self.stays(self._index - owner - 1, count):
                return hold(self._joints)
        return super()._motion_to(point)


@misrun("6.5/25")
class StraightToItsFirstPoint(_StaysAt):
    """A straight move ends at its first point."""

    def stays(self, place: int, count: int) -> bool:  # noqa: ARG002 - one signature for all
        """All others."""
        return place > 0


@misrun("6.5/25")
class StraightWithoutItsLastPoint(_StaysAt):
    """A straight move of several points ends at the last but one."""

    def stays(self, place: int, count: int) -> bool:
        """The last one."""
        return 0 < place == count - 1


@misrun("6.5/25")
class StraightToItsLastPoint(_StaysAt):
    """A straight move passes over all points but its last."""

    def stays(self, place: int, count: int) -> bool:
        """All others."""
        return place < count - 1


@misrun("6.5/25")
class StraightPastTheMiddle(_StaysAt):
    """A straight move of three points or more passes over its second."""

    def stays(self, place: int, count: int) -> bool:
        """That one."""
        return 0 < place < count - 1


@misrun("6.5/25", subtle=True)
class StraightToItsSixteenthPoint(_StaysAt):
    """A straight move ends at its sixteenth point, for no more are kept."""

    def stays(self, place: int, count: int) -> bool:  # noqa: ARG002 - one signature for all
        """Those behind it."""
        return place > 15


class _Targets(Run):
    """Takes points for others."""

    def values(self, point: Point) -> tuple[float, float, float, float]:
        """The values that it takes."""
        return point.values

    def _target(self, point: Point, near: Joints) -> Joints:
        return super()._target(Point(self.values(point)), near)


@misrun("6.5/27")
class PointsSwapTheArms(_Targets):
    """The first two values of a point are taken for each other."""

    def values(self, point: Point) -> tuple[float, float, float, float]:
        """Swap them."""
        a, b, c, d = point.values
        return b, a, c, d


@misrun("6.5/27")
class PointsOfWholeDegrees(_Targets):
    """The values of a point lose what is behind the decimal point."""

    def values(self, point: Point) -> tuple[float, float, float, float]:
        """Drop it."""
        a, b, c, d = map(math.trunc, point.values)
        return a, b, c, d


@misrun("6.5/27")
class PointsWithoutRotation(_Targets):
    """The last value of a point is left out: the rotation stays what it is."""

    def values(self, point: Point) -> tuple[float, float, float, float]:
        """Keep the rotation."""
        a, b, c, _ = point.values
        return a, b, c, self._joints.rotation_deg


@misrun("6.5/27")
class PointsWithoutHeight(_Targets):
    """The third value of a point is left out: the wrist stays where it is."""

    def values(self, point: Point) -> tuple[float, float, float, float]:
        """Keep the height."""
        a, b, _, d = point.values
        return a, b, self._joints.wrist_mm, d


@misrun("6.5/27")
class GoesHalfTheWay(Run):
    """A move ends half the way to its point."""

    def _motion_to(self, point: Point) -> Motion:
        target = self._target(point, self._joints)
        half = Joints(*((p + q) / 2 for p, q in zip(self._joints, target, strict=True)))
        return move(self._joints, half, 50)


@misrun("6.5/27")
class EndsBeforeItArrives(Run):
    """A program goes on, and ends, while the arm is still on its way to a point."""

    def _move(self, motion: Motion, now_s: float) -> float:
        super()._move(motion, now_s)
        return now_s


@misrun("6.5/27")
class CurvesWithoutTheirLastPoint(Run):
    """A curve ends at its last point but one."""

    def _curve(self, node: Node) -> Motion:
        motion = super()._curve(node)
        points = self._program.nodes[self._index - node.counts + 1 : self._index]
        targets = [self._target(p.data, self._joints) for p in points if isinstance(p.data, Point)]
        return curve(self._joints, targets, node.speed_rate) if targets else motion


@misrun("6.5/27")
class RefusesPoints(Run):
    """Every move to a point fails."""

    def _motion_to(self, point: Point) -> Motion:  # noqa: ARG002 - whatever it is
        raise ZeroDivisionError
