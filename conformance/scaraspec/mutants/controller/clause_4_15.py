"""Faults of clause 4.15: running a program."""

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.protocol.program_files import Program
from scaraspec.virtual_controller.behaviour.base import ACCEPTED
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import RUNNING
from scaraspec.virtual_controller.session import Request, Session


@mutant("runs-before-it-looks", "4.15/2", "4.15/7")
class RunsBeforeItLooks(ControllerCore):
    """A missing program is accepted and then said to be done."""

    def run_program(self, request: Request) -> Acceptance:
        """Find an empty program where there is none."""
        answer = super().run_program(request)
        if answer.code != "20":
            return answer
        self.send_result(request, Outcome(done=True))
        return ACCEPTED


@mutant("runs-despite-fault", "4.15/2")
class RunsDespiteFault(ControllerCore):
    """A program is run although a motor has failed."""

    def run_program(self, request: Request) -> Acceptance:
        """Do not look at the motors."""
        if self.plant.fault_code and self.robot.task is None:
            self.send_result(request, Outcome(done=True))
            return ACCEPTED
        return super().run_program(request)


@mutant("runs-what-it-has-refused", "4.15/2", subtle=True)
class RunsWhatItHasRefused(ControllerCore):
    """A run of a missing program is refused, and the robot is busy with it all the same."""

    _until_s = -1.0

    def run_program(self, request: Request) -> Acceptance:
        """Set the state before looking."""
        answer = super().run_program(request)
        if answer.code == "20":
            self._until_s = request.now_s + 0.1
        return answer

    def get_status(self, request: Request) -> str:
        """Tell of the run."""
        return RUNNING if request.now_s < self._until_s else super().get_status(request)


@mutant("refuses-run-in-one-byte", "4.15/3")
class RefusesRunInOneByte(ControllerCore):
    """The refusal of a run has no code."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Send the flag alone."""
        if frame.opcode == 0x30 and frame.data.startswith(b"0|"):
            frame = frame._replace(data=b"0")
        super().emit(session, frame)


@mutant("refuses-run-with-number", "4.15/3")
class RefusesRunWithNumber(ControllerCore):
    """The code in the refusal of a run is one byte, not two characters."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Send the code's value."""
        if frame.opcode == 0x30 and frame.data.startswith(b"0|"):
            frame = frame._replace(data=b"0|" + bytes.fromhex(frame.data[2:].decode()))
        super().emit(session, frame)


@mutant("runs-nothing", "4.15/4")
class RunsNothing(ControllerCore):
    """Every run is refused as if its program were missing."""

    def run_program(self, request: Request) -> Acceptance:
        """Look in the wrong folder."""
        answer = super().run_program(request)
        if answer.accepted:
            self.robot.task = None
            return Acceptance(accepted=False, code="20")
        return answer


@mutant("accepts-run-with-its-name", "4.15/4")
class AcceptsRunWithItsName(ControllerCore):
    """The first reply to a run repeats the program's name behind the 1."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Add the name."""
        if frame.opcode == 0x30 and frame.data == b"1" and not frame.tagged:
            frame = frame._replace(data=b"1|zs.rob")
        super().emit(session, frame)


@mutant("runs-short-names-alone", "4.15/4", subtle=True)
class RunsShortNamesAlone(ControllerCore):
    """A program whose name has more than sixteen bytes cannot be run."""

    def _program(self, name: bytes | None) -> Program | None:
        return None if name is not None and len(name) > 16 else super()._program(name)


@mutant("runs-program-once", "4.15/4", subtle=True)
class RunsProgramOnce(ControllerCore):
    """A program that has been run before is refused."""

    _ran: tuple[bytes, ...] = ()

    def _program(self, name: bytes | None) -> Program | None:
        if name is None or name in self._ran:
            return None
        self._ran = (*self._ran, name)
        return super()._program(name)


@mutant("run-has-no-result", "4.15/5")
class RunHasNoResult(ControllerCore):
    """A run that comes to its end sends no final result."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Leave it out."""
        if request.command.name != "run_program" or not outcome.done:
            super().send_result(request, outcome)


@mutant("run-ends-untagged", "4.15/5")
class RunEndsUntagged(ControllerCore):
    """The final result of a run bears no tag."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Leave the tag away."""
        if frame.opcode == 0x30 and frame.tagged:
            frame = frame._replace(tagged=False)
        super().emit(session, frame)


@mutant("run-ends-under-its-neighbour", "4.15/5")
class RunEndsUnderItsNeighbour(ControllerCore):
    """The final result of a run bears the opcode of the simulation."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Use the other opcode."""
        if frame.opcode == 0x30 and frame.tagged:
            frame = frame._replace(opcode=0x31)
        super().emit(session, frame)


@mutant("run-ends-at-once", "4.15/5", "4/15")
class RunEndsAtOnce(ControllerCore):
    """The final result of a run is sent as soon as it was accepted; the program goes on."""

    _told = False

    def run_program(self, request: Request) -> Acceptance:
        """Conclude at once."""
        answer = super().run_program(request)
        if answer.accepted:
            self.send_result(request, Outcome(done=True))
            self._told = True
        return answer

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Conclude once."""
        if request.command.name == "run_program" and self._told:
            self._told = False
            return
        super().send_result(request, outcome)


@mutant("good-run-fails", "4.15/5")
class GoodRunFails(ControllerCore):
    """A run that comes to its end is told as a failure."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Take the end of the program for an error."""
        if request.command.name == "run_program" and outcome.done:
            outcome = Outcome(done=False, code="05")
        super().send_result(request, outcome)


@mutant("runs-the-nearest-name", "4.15/7")
class RunsTheNearestName(ControllerCore):
    """A name that begins like a stored program runs that program."""

    def _program(self, name: bytes | None) -> Program | None:
        near = (each for each in self.store.names() if name and each.startswith(name))
        return super()._program(next(near, name))


@mutant("runs-the-beginning-of-name", "4.15/7")
class RunsTheBeginningOfName(ControllerCore):
    """A name that goes on behind that of a stored program runs that program."""

    def _program(self, name: bytes | None) -> Program | None:
        near = (each for each in self.store.names() if name and name.startswith(each))
        return super()._program(next(near, name))


@mutant("adds-the-extension", "4.15/7")
class AddsTheExtension(ControllerCore):
    """A name without its extension runs the program that has it."""

    def _program(self, name: bytes | None) -> Program | None:
        if name is not None and b"." not in name:
            name += b".rob"
        return super()._program(name)


@mutant("runs-deleted-programs", "4.15/7")
class RunsDeletedPrograms(ControllerCore):
    """A program that was run stays in memory, and is run again when it has been deleted."""

    def __init__(self, *arguments: object, **named: object) -> None:
        """Begin with an empty memory."""
        super().__init__(*arguments, **named)  # type: ignore[arg-type] # what a core takes
        self._loaded: dict[bytes, Program] = {}

    def _program(self, name: bytes | None) -> Program | None:
        program = super()._program(name) or self._loaded.get(name or b"")
        if program is not None and name is not None:
            self._loaded[name] = program
        return program


@mutant("runs-what-was-only-named", "4.15/7")
class RunsWhatWasOnlyNamed(ControllerCore):
    """A program of which nothing but the name was sent runs, and is done."""

    def run_program(self, request: Request) -> Acceptance:
        """Take an upload for the program."""
        transfers = [s.transfer.name for s in self.sessions.values() if s.transfer is not None]
        if request.value in transfers and self.robot.task is None:
            self.send_result(request, Outcome(done=True))
            return ACCEPTED
        return super().run_program(request)


@mutant("missing-program-is-position-fault", "4.15/7")
class MissingProgramIsPositionFault(ControllerCore):
    """A missing program is refused with 05."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 05 for 20."""
        if frame.opcode == 0x30 and frame.data == b"0|20":
            frame = frame._replace(data=b"0|05")
        super().emit(session, frame)


@mutant("second-run-replaces-the-first", "4.15/8", "4/6")
class SecondRunReplacesTheFirst(ControllerCore):
    """A second run during a run takes its place."""

    def run_program(self, request: Request) -> Acceptance:
        """Let go of the one before."""
        task = self.robot.task
        if task is not None and task.program and task.program != request.value:
            self.robot.task = None
        return super().run_program(request)


@mutant("same-run-is-accepted-again", "4.15/8")
class SameRunIsAcceptedAgain(ControllerCore):
    """The program that runs may be started again, which changes nothing."""

    def run_program(self, request: Request) -> Acceptance:
        """Accept what runs already."""
        task = self.robot.task
        if task is not None and task.program == request.value:
            return ACCEPTED
        return super().run_program(request)


@mutant("second-client-runs", "4.15/8")
class SecondClientRuns(ControllerCore):
    """A second client may begin a run during the first one's."""

    def run_program(self, request: Request) -> Acceptance:
        """Look at one's own run alone."""
        task = self.robot.task
        if task is not None and task.request.session is not request.session:
            self.robot.task = None
        return super().run_program(request)
