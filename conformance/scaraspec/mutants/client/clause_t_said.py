"""Faults of what a client hands on: numbers, bits, names, times, codes and outcomes."""

from typing import Any

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore, Event
from scaraspec.client.errors import ClientError, ProtocolError, Refused
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.client.results import RunningProgram
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import (
    AltersReplies,
    AltersResults,
    TakesLossForSuccess,
)
from scaraspec.protocol.commands import BY_OPCODE, JointValues, PortValue
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import FLAG

# Numbers


@mutant("loses-the-minus", "T/9")
class LosesTheMinus(AltersReplies):
    """Negative joint angles are told as positive ones."""

    name = "get_joint_angles"

    def altered(self, data: bytes) -> bytes:
        """Lose it."""
        return data.replace(b"-", b"")


@mutant("rounds-coordinates", "T/9")
class RoundsCoordinates(AltersReplies):
    """The gripper centre is told in whole numbers."""

    name = "get_gripper_center"

    def altered(self, data: bytes) -> bytes:
        """Round them."""
        return b"|".join(b"%d" % round(float(text)) for text in data.split(b"|"))


@mutant("minus-only-ahead-of-wholes", "T/9", subtle=True)
class MinusOnlyAheadOfWholes(AltersReplies):
    """The sign of a number between 0 and -1 is lost, because its whole part is read by itself."""

    name = "get_tool_coordinates"

    def altered(self, data: bytes) -> bytes:
        """Lose it."""
        return data.replace(b"-0.", b"0.")


@mutant("wants-decimals", "T/5", subtle=True)
class WantsDecimals(AltersReplies):
    """Joint angles without decimals cannot be read."""

    name = "get_joint_angles"

    def altered(self, data: bytes) -> bytes:
        """Read them, or not."""
        return data if all(b"." in text for text in data.split(b"|")) else b""


@mutant("reads-one-decimal", "T/5", "T/9", subtle=True)
class ReadsOneDecimal(AltersReplies):
    """Of the decimals of the joint angles only the first is read."""

    name = "get_joint_angles"

    def altered(self, data: bytes) -> bytes:
        """Read it."""
        return b"|".join(text[: text.find(b".") + 2 or None] for text in data.split(b"|"))


@mutant("swaps-joints", "T/9")
class SwapsJoints(AltersReplies):
    """The temperatures of both arms are told the other way round."""

    name = "get_motor_temperatures"

    def altered(self, data: bytes) -> bytes:
        """Swap them."""
        inner, outer, *others = data.split(b"|")
        return b"|".join((outer, inner, *others))


@mutant("reverses-bits", "T/9")
class ReversesBits(AsyncClient):
    """The digital inputs are told lowest port first."""

    async def get_digital_inputs(self) -> str:
        """Reverse them."""
        return (await super().get_digital_inputs())[::-1]


@mutant("drops-leading-zeros", "T/9", subtle=True)
class DropsLeadingZeros(AsyncClient):
    """The digital outputs are told as a number is, without the zeros ahead of the first one."""

    async def get_digital_outputs(self) -> str:
        """Drop them."""
        return (await super().get_digital_outputs()).lstrip("0")


@mutant("no-value-is-zero", "T/9")
class NoValueIsZero(AsyncClient):
    """An analog input that cannot be read is told as 0."""

    async def get_analog_input(self, port: int) -> float:
        """Make it so."""
        try:
            return await super().get_analog_input(port)
        except Refused:
            return 0.0


# Times


@mutant("forgets-days", "T/9", subtle=True)
class ForgetsDays(AltersReplies):
    """Of a run time only hours, minutes and seconds are read."""

    name = "get_running_program"

    def altered(self, data: bytes) -> bytes:
        """Forget the days."""
        return data[:-8] + b"00" + data[-6:] if len(data) > 8 else data


@mutant("windows-years", "T/9", subtle=True)
class WindowsYears(AltersReplies):
    """Of a year only two digits are read, and those from 70 on mean the last century."""

    name = "get_time"

    def altered(self, data: bytes) -> bytes:
        """Read them."""
        return (b"19" if data[2:4] >= b"70" else b"20") + data[2:]


@mutant("minutes-for-months", "T/9")
class MinutesForMonths(AltersReplies):
    """The month is told where the minute is due."""

    name = "get_time"

    def altered(self, data: bytes) -> bytes:
        """Put it there."""
        return data[:10] + data[4:6] + data[12:]


# Names


@mutant("cuts-the-running-name", "T/9", subtle=True)
class CutsTheRunningName(AltersReplies):
    """The name of the running program is cut to thirty bytes."""

    name = "get_running_program"

    def altered(self, data: bytes) -> bytes:
        """Cut it."""
        flag, bar, rest = data.partition(b"|")
        name, *time = rest.split(b"|")
        return flag + bar + b"|".join((name[:30], *time))


@mutant("running-for-nothing", "T/9")
class RunningForNothing(AltersReplies):
    """Where no program runs, one without a name is told."""

    name = "get_running_program"

    def altered(self, data: bytes) -> bytes:
        """Make it up."""
        return b"1|-|00000000" if data == b"0" else data


@mutant("empty-fields-are-program", "T/9", subtle=True)
class EmptyFieldsAreProgram(AltersReplies):
    """Where no program runs, which is told by empty fields, one without a name is told."""

    name = "get_running_program"

    def altered(self, data: bytes) -> bytes:
        """Make it up."""
        return b"1|-|00000000" if data == b"0||" else data


@mutant("cuts-the-default-name", "T/9")
class CutsTheDefaultName(AltersReplies):
    """The name of the default program is told without its extension."""

    name = "get_default_program"

    def altered(self, data: bytes) -> bytes:
        """Cut it."""
        return data.partition(b".")[0]


@mutant("no-default-is-main", "T/9", subtle=True)
class NoDefaultIsMain(AltersReplies):
    """Where no default program is set, main.rob is told."""

    name = "get_default_program"

    def altered(self, data: bytes) -> bytes:
        """Make it up."""
        return b"main.rob" if data in (b"", b"0") else data


# Outcomes and codes


@mutant("every-flag-is-yes", "T/9")
class EveryFlagIsYes(ClientCore):
    """The no to a setting is taken for a yes."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        command = BY_OPCODE.get(frame.opcode)
        setting = command is not None and command.reply is FLAG and command.name != "login"
        no = setting and frame.data == b"0" and not frame.tagged
        return super()._dispatch(frame._replace(data=b"1") if no else frame, now_s)


@mutant("outputs-always-set", "T/9", subtle=True)
class OutputsAlwaysSet(AsyncClient):
    """Setting an output is told as done, whatever the controller says."""

    async def set_digital_output(self, port: int, value: int) -> None:
        """Set it."""
        operation = self._core.command("set_digital_output", PortValue(port, value))
        await self._settled(operation)

    async def _settled(self, operation: PendingOperation) -> None:
        await self.wait_for(lambda: self._core.is_free(operation.slot))
        self._core.begin(operation, 0.0)
        self._update()
        await self.wait_for(lambda: operation.settled)


@mutant("knows-what-it-has-set", "T/9", subtle=True)
class KnowsWhatItHasSet(AsyncClient):
    """The default program that was set is told from memory, and not asked for."""

    _set: str | None = None

    async def set_default_program(self, name: Any) -> None:
        """Remember it."""
        await super().set_default_program(name)
        self._set = name

    async def get_default_program(self) -> str | None:
        """Tell it."""
        return self._set or await super().get_default_program()


@mutant("knows-what-it-runs", "T/9", subtle=True)
class KnowsWhatItRuns(AsyncClient):
    """While a program runs that it has begun, that is told to run, and not asked for."""

    _runs: str | None = None

    async def run_program(self, name: Any) -> None:
        """Remember it."""
        self._runs = name
        try:
            await super().run_program(name)
        finally:
            self._runs = None

    async def get_running_program(self) -> RunningProgram | None:
        """Tell it."""
        return RunningProgram(self._runs, 1) if self._runs else await super().get_running_program()


@mutant("nonsense-is-the-last-word", "T/9", subtle=True)
class NonsenseIsTheLastWord(AsyncClient):
    """Behind temperatures that it could not read it does not ask for them any more."""

    _unread = False

    async def get_motor_temperatures(self) -> JointValues:
        """Ask, or not."""
        if self._unread:
            raise ClientError("the temperatures cannot be read")
        try:
            return await super().get_motor_temperatures()
        except ProtocolError:
            self._unread = True
            raise


@mutant("sets-outputs-once", "T/9", subtle=True)
class SetsOutputsOnce(AsyncClient):
    """An output that was set to a value is not set to it again, and told as done."""

    _last: tuple[int, int] | None = None

    async def set_digital_output(self, port: int, value: int) -> None:
        """Set it."""
        if self._last != (port, value):
            await super().set_digital_output(port, value)
            self._last = port, value


@mutant("takes-loss-for-deletion", "T/9", subtle=True)
class TakesLossForDeletion(TakesLossForSuccess):
    """A link that is lost before a deletion was answered is taken for the deletion."""

    name = "delete_program"


@mutant("takes-loss-for-new-password", "T/9", subtle=True)
class TakesLossForNewPassword(TakesLossForSuccess):
    """A link that is lost before a new password was answered is taken for its change."""

    name = "set_password"


@mutant("failures-are-done", "T/9")
class FailuresAreDone(AltersResults):
    """A command that was begun and not done is told as done."""

    def altered(self, data: bytes) -> bytes:
        """Make it so."""
        return b"11" if data.startswith(b"00|") else data


@mutant("codes-are-decimal", "T/9", subtle=True)
class CodesAreDecimal(ClientCore):
    """Of a code only its decimal digits are read."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        head, bar, code = frame.data.rpartition(b"|")
        if head in (b"0", b"00") and len(code) == 2 and not code.isdigit():
            frame = frame._replace(data=head + bar + code[:1] + b"0")
        return super()._dispatch(frame, now_s)


# Beyond ASCII


@mutant("question-marks", "T/8")
class QuestionMarks(AltersReplies):
    """What is not ASCII in a listed name is told as question marks."""

    name = "list_programs"

    def altered(self, data: bytes) -> bytes:
        """Put them in."""
        return bytes(byte if byte < 0x80 else ord("?") for byte in data)


@mutant("leaves-out-the-foreign", "T/8", subtle=True)
class LeavesOutTheForeign(AltersReplies):
    """What is not ASCII in a listed name is left out."""

    name = "list_programs"

    def altered(self, data: bytes) -> bytes:
        """Leave it out."""
        return bytes(byte for byte in data if byte < 0x80)
