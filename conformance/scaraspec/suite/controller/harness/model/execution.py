"""Steps that run programs, move the arm, stop the robot and switch outputs."""

from collections.abc import Callable
from functools import partial
from typing import Final

from scaraspec.protocol.commands import Point, Pose, RunningProgram
from scaraspec.protocol.fields import show
from scaraspec.protocol.payloads import JogDirection
from scaraspec.suite.controller.harness.controller_under_test import (
    MOMENT_S,
    SILENCE_S,
)
from scaraspec.suite.controller.harness.model.files import FileSteps
from scaraspec.suite.controller.harness.model.state import (
    ENDLESS,
    IDLE_STOP,
    SWITCHED_OFF_BY,
    Step,
    Writes,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import SLACK_S
from scaraspec.suite.controller.harness.requests.motion import (
    IDLE,
    REACHED,
    ask_move,
    await_own_result,
    in_box,
    is_out_of_reach,
    is_responsive,
    pose_deviation,
    pose_of,
    release_latch,
    same_place,
    status_after_result,
    stop,
    stop_motion,
    stop_without_reset,
)
from scaraspec.suite.controller.harness.requests.ports import (
    ALL_OUTPUTS,
    Bits,
    digits,
    outputs,
    set_output,
    with_port,
)
from scaraspec.suite.controller.harness.requests.queries import Query
from scaraspec.suite.controller.harness.two_stage.commands import (
    JOG,
    MOVE,
    RESET,
    RUN,
    SIMULATE,
    STATES,
    STOP,
    begin,
    expect_accepted,
    try_request,
)
from scaraspec.suite.controller.harness.two_stage.jogs import (
    expect_direction,
    position_of,
    wait_for_motion,
)
from scaraspec.suite.controller.harness.two_stage.results import (
    expect_success,
    locked_afterwards,
    poll_result,
    release_joints,
    stop_while_idle,
)
from scaraspec.suite.controller.harness.two_stage.tasks import begin_jog
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import CaseFailed, expect, expect_equal
from scaraspec.suite.program_files.layout import configured
from scaraspec.user_message import UserMessage

_NS: Final = 1e9
_AXES: Final = 4  # the values of a pose that have a meaning (L1006)
_FARTHEST_MM: Final = 1.8
"""How far a move goes from the start pose in an axis; less than `REACHED` would not show."""
_DIRECTIONS: Final = (
    *((1, 0, 0, 0), (0, -1, 0, 0), (0, 0, 1, 0), (0, 0, 0, -1)),
    *((-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, -1, 0), (0, 0, 0, 1)),
    *((1, -1, 1, -1), (-1, 1, -1, 1)),
)
"""Each axis of a pose alone, and all of them together."""
_DURING_A_PROGRAM: Final = (
    ("get_poses", "set_initial", "get_poses"),
    ("set_output", "get_outputs"),
    ("list_programs", "get_default"),
    ("set_centre", "get_poses"),
    ("query", "get_clock"),
)
"""Steps that take place while a program executes."""
_STOPS_ELSEWHERE: Final = 3  # one of so many stops is sent on another connection
_JOGS: Final = (
    *(JogDirection.PLUS_Y, JogDirection.PLUS_X, JogDirection.MINUS_Y, JogDirection.MINUS_X),
    *(JogDirection.PLUS_Y, JogDirection.MINUS_X, JogDirection.MINUS_Y, JogDirection.PLUS_X),
)
"""Jogs in each direction, after each direction of the other axis."""
_ZERO: Final = Point(0, 0, 0)
_ALL_OFF: Final = (False,) * len(ALL_OUTPUTS)


class ExecutionSteps(FileSteps):
    """Starts and stops commands, and sets outputs."""

    def _look(self, _: Step, line: OutgoingConnection) -> str:
        self._expect_executing(line)
        return UserMessage("query the status and the running program")

    def _expect_executing(self, line: OutgoingConnection) -> None:
        """Require that the status and the running program are those of the executing command."""
        if self._simulation_ended(within_s=0):
            return
        command, name = self._running[:2] if self._running else ("", b"")
        status = line.ask("get_status") if command else status_after_result(line)
        reply = line.ask("get_running_program")
        expected = STATES[command] if command else IDLE
        if status.value != expected and self._simulation_ended(within_s=SILENCE_S):
            return
        expect(
            status.value == expected,
            UserMessage(
                "the status is {status} while {command} executes",
                status=status.value,
                command=command or "nothing",
            ),
            expected=expected,
            observed=f"{status}",
            requirement={RUN: "4.8/4", SIMULATE: "4.8/5"}.get(command, "4.8/3"),
        )
        running = reply.value if isinstance(reply.value, RunningProgram) else None
        if command == RUN or (running and command):  # a simulation may be unreported (A-4.9-4)
            expect(
                running is not None and running.name == name,
                "the reported program is not the one that runs",
                expected=show(name),
                observed=f"{reply}",
                requirement="4.9/4" if running else "4.9/2",
            )
        elif running:
            raise _no_program_error(reply)
        if running:
            longest_s = (reply.time_s - self._started_s) * self._subject.ics.time_scale
            expect(
                running.run_time_s <= longest_s + SLACK_S,
                "the run time is longer than this run of the program",
                expected=UserMessage("at most {limit_s} s", limit_s=f"{longest_s:.1f}"),
                observed=f"{running.run_time_s} s",
                requirement="4.9/5",
            )

    def _set_output(self, step: Step, line: OutgoingConnection) -> str | None:
        rounds, index = divmod(step.turn, len(self._ports))
        port, on = self._ports[index], bool((rounds + index) % 2)
        answer = set_output(line, port, on=on)
        if self._running and not answer.accepted:  # A-4.32-4
            return UserMessage("set output {port}, refused", port=port)
        expect(
            answer.accepted,
            UserMessage(
                "output {port} could be set before and cannot be set to {value:d}",
                port=port,
                value=on,
            ),
            expected="1",
            observed=f"{answer}",
            requirement="4.32/4",
        )
        self._outputs = {by: with_port(bits, port, on=on) for by, bits in self._outputs.items()}
        return UserMessage("set output {port} to {value}", port=port, value=int(on))

    def _get_outputs(self, _: Step, line: OutgoingConnection) -> str:
        reported, as_set = outputs(line), self._outputs[frozenset()]
        if reported != as_set and reported in self._outputs.values():
            message = "the outputs are switched off when a program starts or is stopped"
            self._subject.tolerate("4.32/6", "A-4.32-3", "off", message)
        else:
            message = "the outputs differ from what was set"
            expect_equal(digits(reported), digits(as_set), message, requirement="4.32/6")
        self._outputs = dict.fromkeys(SWITCHED_OFF_BY, reported)
        return UserMessage("query the outputs")

    def _note_switch_off(self, event: str) -> None:
        for by in self._outputs:
            if event in by:
                self._outputs[by] = _ALL_OFF

    def _note_program_settings(self, line: OutgoingConnection) -> None:
        """Note that a program may set the gripper center and initial position (A-6.3-3)."""
        base = configured(self._subject, line)
        if self._centers:
            self._centers.append(base.tool_center)
        if self._initials:
            self._initials.append(base.tool_position[:_AXES])

    def _run(self, step: Step, line: OutgoingConnection) -> str | None:
        return self._begin(RUN, self._name(step), line)

    def _simulate(self, step: Step, line: OutgoingConnection) -> str | None:
        return self._begin(SIMULATE, self._name(step), line)

    def _interrupt(self, step: Step, line: OutgoingConnection) -> str | None:
        """Start a program that does not end, perhaps try another command, and stop it.

        In every second turn, another connection is closed and opened again during the program. A
        stopped simulation is followed by the run of a program that sets outputs.
        """
        uploaded = None
        if not self._endless_programs:
            uploaded = self._upload(step._replace(value=ENDLESS), line)
            if not self._endless_programs:  # the name was in use
                return uploaded
        command, other = ((SIMULATE, RUN)[n % 2] for n in (step.value, step.seed))
        executing = self._endless_programs[0]
        begun, refused = self._begin(command, executing, line), None
        others = [each for each in self._lines if each is not line]
        if step.turn % 2 and others and self._running and not self._unresponsive:
            self._expect_executing(self._replace(others[0]))
        if self._running and not self._unresponsive:
            for act in _DURING_A_PROGRAM[step.turn % len(_DURING_A_PROGRAM)]:
                if act in self._acts:
                    getattr(self, f"_{act}")(step._replace(act=act), line)
        if step.value > 1 and self._running:
            name = next((n for n in self._files if n != executing), self._name(step))
            refused = self._expect_busy(other, name, line)
        self._stop(step, line)
        written = next((n for n in self._files if self._writes.get(n)), None)
        ran = self._begin(RUN, written, line) if written and command == SIMULATE else None
        done = (uploaded, begun, refused, UserMessage("stop"), ran)
        return UserMessage.listed(filter(None, done), semicolons=True)

    def _begin(self, command: str, name: bytes, line: OutgoingConnection) -> str | None:
        if self._running and not self._simulation_ended(within_s=0):
            return self._expect_busy(command, name, line)
        self._subject.moved = True
        self._started_s = self._subject.now_ns / _NS
        answer = line.ask(command, name)
        if name not in self._files:
            if answer.accepted:  # it may fail late (A-4.15-1)
                result = line.result(command)
                message = UserMessage(
                    "{command} of a program that is not stored succeeds", command=command
                )
                expect(not result.done, message, observed=f"{result}", requirement="4.15/7")
            return UserMessage(
                "{command} {name}, which is not stored", command=command, name=show(name)
            )
        expect_accepted(command, answer)
        self._note_program_settings(line)
        self._note_switch_off(command)
        if name in self._endless_programs:
            self._running = command, name, line
            return UserMessage(
                "{command} {name}, which does not end", command=command, name=show(name)
            )
        expect_success(self._subject, line, command)
        self._expect_written(command, name, line)
        return f"{command} {show(name)}"

    def _expect_written(self, command: str, name: bytes, line: OutgoingConnection) -> None:
        """Require the outputs that a program sets. A simulation need not set them (A-4.16-1)."""
        if not (writes := self._writes[name]):
            return
        reported, before = outputs(line), self._outputs
        after = {by: _written(bits, writes) for by, bits in before.items()}
        if command == SIMULATE:
            is_set = reported in after.values() and reported not in before.values()
            self._outputs = after if is_set else before
            return
        self._outputs = after
        if _written(reported, writes) != reported:
            message = UserMessage("the outputs are not those that {name} sets", name=show(name))
            expected = digits(self._outputs[frozenset()])
            expect_equal(digits(reported), expected, message, requirement="6.5/19")

    def _expect_busy(self, command: str, name: bytes, line: OutgoingConnection) -> str | None:
        if self._unresponsive or self._subject.dialect["busy_reply"] == "queue":
            return None
        answer = try_request(line, command, name)
        if answer is not None and answer.accepted and self._simulation_ended(within_s=0):
            stop_motion(self._subject, line)
            return UserMessage(
                "{command} {name} after the end of a simulation", command=command, name=show(name)
            )
        expect(
            answer is None or not answer.accepted,
            UserMessage(
                "{command} is accepted while {executing} executes",
                command=command,
                executing=self._running[0] if self._running else "",
            ),
            expected="0|01 or 0|02",
            observed=f"{answer}",
            requirement="4/6",
        )
        self._expect_executing(line)
        return UserMessage("{command} {name} while it executes", command=command, name=show(name))

    def _move(self, step: Step, line: OutgoingConnection) -> str | None:
        """Move to a pose near the start pose, and observe this on another connection.

        0x39 may refer to the gripper center (A-4.23-1), so this is zero.
        """
        home, motion = self._scene.home, self._subject.ics.motion
        if home is None or not self._zero_center(line):
            return None
        length = min(_FARTHEST_MM, motion.step_mm / 2) * step.random.uniform(0.7, 1)
        way = (*(length * sign for sign in _DIRECTIONS[step.turn % len(_DIRECTIONS)]), 0, 0)
        target = Pose(*(round(a + b, 1) for a, b in zip(home, way, strict=True)))
        if not in_box(self._subject, target):
            return None
        if not self._begin_motion(MOVE, partial(ask_move, self._subject, line, target)):
            return None
        self._scene.place = target
        other = self._other(line)
        if (
            self._subject.lag.is_absent
            and self._subject.traits.unresponsive_while_executing is False
        ):
            self._expect_moving(line, other)
            if step.turn % 2:
                status = Query("get_status")
                wait = partial(await_own_result, self._subject, line)
                self._query_around(status, step, line, wait)
        expect_success(self._subject, line, MOVE)
        self._expect_place(other, target)
        return UserMessage("move to {position}", position=target[:_AXES])

    def _jog(self, step: Step, line: OutgoingConnection) -> str | None:
        """Jog for a moment, and observe this on another connection."""
        subject, other = self._subject, self._other(line)
        if self._scene.home is None or subject.traits.unresponsive_while_executing is not False:
            return None
        direction = _JOGS[step.turn % len(_JOGS)]
        before = position_of(line)
        if not in_box(subject, before.pose):
            return None
        if not self._begin_motion(JOG, partial(begin_jog, subject, line, direction)):
            return None
        self._scene.place = None
        wait_for_motion(subject, other)
        if subject.lag.is_absent and is_responsive(subject, other, jogs=True):
            self._expect_moving(line, other)
        ended_early = poll_result(line, JOG) is not None
        self._note_switch_off(STOP)
        stop_without_reset(subject, line)
        poll_result(line, JOG)
        after = position_of(other)
        release_latch(subject, line)
        if same_place(after.pose, before.pose):
            expect(
                ended_early or direction not in self._scene.jogged,
                "a jog does not move the arm, although it did before",
                expected=f"{direction}",
                observed=f"{after.pose[:3]}",
                requirement="4.28/3",
            )
        else:
            self._scene.jogged.add(direction)
            expect_direction(subject, direction, before, after)
            expect(
                after.joints != before.joints or not any(angle % 1 for angle in after.joints),
                "the joint angles are unchanged although the tool has moved",
                expected=UserMessage("others than {joints}", joints=before.joints),
                observed=f"{after.joints}",
                requirement="4.27/4",
            )
        self._scene.place = None if subject.traits.latches else after.pose
        return UserMessage("jog towards {direction}", direction=direction)

    def _release(self, _: Step, line: OutgoingConnection) -> str | None:
        """Release the joints and lock them again; the arm may move because of it (A-4.25-1)."""
        if self._scene.home is None:
            return None
        self._scene.place = None
        with locked_afterwards(self._subject, line):
            release_joints(self._subject, line)
        self._scene.place = pose_of(line)
        return UserMessage("release and lock the joints")

    def _reset(self, _: Step, line: OutgoingConnection) -> str | None:
        """Reset a robot that is at its initial tool position (A-4.18-3)."""
        pose = pose_of(line)
        if self._scene.home is None or not in_box(self._subject, pose):
            return None
        if not line.ask("set_initial_tool_position", pose).accepted:
            return None
        self._initials, self._scene.place = [pose[:_AXES]], None
        begin(self._subject, line, RESET)
        expect_success(self._subject, line, RESET)
        self._scene.place = pose_of(line)
        return UserMessage("reset")

    def _begin_motion(self, command: str, request: Callable[[], ReceivedFrame]) -> bool:
        """Start a motion; return False if the target is out of reach.

        Raises:
            CaseFailed: It is refused, or accepted only when it is requested again.
        """
        answer = request()
        if is_out_of_reach(answer):
            if is_out_of_reach(again := request()):
                return False
            if again.accepted:
                stop_motion(self._subject, self._lines[0])
        expect_accepted(command, answer)
        return True

    def _other(self, line: OutgoingConnection) -> OutgoingConnection:
        """Return another connection, or the same one if there is no other."""
        return next((each for each in self._lines if each is not line), line)

    def _expect_moving(self, line: OutgoingConnection, other: OutgoingConnection) -> None:
        """Require the status of a move, unless the move ends at about this time.

        A running program must not be reported.
        """
        status, reply = other.ask("get_status"), other.ask("get_running_program")
        if isinstance(reply.value, RunningProgram):
            raise _no_program_error(reply)
        if status.value != STATES[MOVE]:
            line.wait(MOMENT_S)
        expect(
            status.value == STATES[MOVE] or any(seen.frame.tagged for seen in line.inbox),
            "the status is another one while the arm moves",
            expected=STATES[MOVE],
            observed=f"{status}",
            requirement="4.8/7",
        )

    def _zero_center(self, line: OutgoingConnection) -> bool:
        if self._centers != [_ZERO]:
            if not line.ask("set_gripper_center", _ZERO).accepted:
                return False
            self._centers = [_ZERO]
        return True

    def _expect_place(self, line: OutgoingConnection, place: Pose) -> None:
        at = pose_of(line)
        expect(
            pose_deviation(at, place) <= REACHED,
            "the arm is not at the target of its last move",
            expected=f"{place[:_AXES]}",
            observed=f"{at[:_AXES]}",
            requirement="4.24/8",
        )

    def _get_place(self, _: Step, line: OutgoingConnection) -> str | None:
        if self._scene.place is None or self._centers != [_ZERO]:
            return None
        self._expect_place(line, self._scene.place)
        return UserMessage("query the pose")

    def _stop(self, step: Step, line: OutgoingConnection) -> str | None:
        """Stop a command on any connection."""
        stopped = self._stopped(step, line)
        if self._subject.traits.latches:  # the reset after it has moved the arm (A-4.17-2)
            self._scene.place = None
        return stopped

    def _stopped(self, step: Step, line: OutgoingConnection) -> str | None:
        self._note_switch_off(STOP if self._running else IDLE_STOP)
        if not self._running:
            stop_while_idle(self._subject, line)
            return IDLE_STOP
        if self._simulation_ended(within_s=0):
            return None
        command, _name, owner = self._running
        stopping = self._other(owner) if step.seed % _STOPS_ELSEWHERE == 0 else owner
        answer = stop(self._subject, stopping, owner)
        if not answer.accepted and self._simulation_ended(within_s=SILENCE_S):
            return None
        expect(
            answer.accepted,
            UserMessage("the stop is refused while {command} executes", command=command),
            expected="1",
            observed=f"{answer}",
            requirement="4.17/3",
        )
        self._running = None
        stop_motion(self._subject, owner)
        return UserMessage("stop" if stopping is owner else "stop on another connection")


def _written(bits: Bits, writes: Writes) -> Bits:
    """Return the outputs after these changes."""
    for port, on in writes.items():
        bits = with_port(bits, port, on=on)
    return bits


def _no_program_error(reply: ReceivedFrame) -> CaseFailed:
    message = "a running program is reported although none runs"
    return CaseFailed(message, expected="0", observed=f"{reply}", requirement="4.9/6")
