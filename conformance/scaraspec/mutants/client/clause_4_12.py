"""Faults of 4.12 to 4.14: the default program, and the temperatures that bear its opcode."""

from collections.abc import Iterable

from scaraspec.client.core import ClientCore, Event
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersRequests
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame

_GET_DEFAULT = BY_NAME["get_default_program"]
_SET_DEFAULT = BY_NAME["set_default_program"].opcode
_TEMPERATURES = BY_NAME["get_motor_temperatures"].opcode


@mutant("asks-for-the-default-with-data", "4.12/1")
class AsksForTheDefaultWithData(AltersRequests):
    """The default program is asked for with a 0."""

    name = "get_default_program"

    def altered(self, data: bytes) -> bytes:
        """Append it."""
        return data + b"0"


@mutant("asks-for-the-default-under-both", "4.12/1", subtle=True)
class AsksForTheDefaultUnderBoth(ClientCore):
    """The default program is asked for under 0D and, with the name of a program, under 13."""

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            super()._send([frame])
            if frame.opcode == _GET_DEFAULT.opcode and _GET_DEFAULT.alternate_opcode:
                super()._send(
                    [frame._replace(opcode=_GET_DEFAULT.alternate_opcode, data=b"pro1.rob")]
                )


@mutant("sends-the-path", "4.13/1")
class SendsThePath(AltersRequests):
    """The name of the default program is sent with the folder that it is in."""

    name = "set_default_program"

    def altered(self, data: bytes) -> bytes:
        """Put it ahead."""
        return b"/programs/" + data


@mutant("sends-the-first-part-of-names", "4.13/1", subtle=True)
class SendsTheFirstPartOfNames(AltersRequests):
    """The name of the default program is sent up to the last point in it, and .rob behind that."""

    name = "set_default_program"

    def altered(self, data: bytes) -> bytes:
        """Replace what follows it."""
        return data.rpartition(b".")[0] + b".rob" if data.count(b".") > 1 else data


@mutant("asks-for-every-motor", "4.14/1")
class AsksForEveryMotor(AltersRequests):
    """The temperatures are asked for with the numbers of the motors."""

    name = "get_motor_temperatures"

    def altered(self, data: bytes) -> bytes:
        """Append them."""
        return data + b"1|2|3|4"


@mutant("takes-temperatures-for-yes", "4.14/4")
class TakesTemperaturesForYes(ClientCore):
    """Whatever comes under 0E is taken for the reply to setting the default program."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        setting = any(each.command.opcode == _SET_DEFAULT for each in self._open)
        mistaken = setting and frame.opcode == _SET_DEFAULT and b"|" in frame.data
        return super()._dispatch(frame._replace(data=b"1") if mistaken else frame, now_s)


@mutant("takes-yes-for-temperatures", "4.14/4", subtle=True)
class TakesYesForTemperatures(ClientCore):
    """Whatever comes under 0E while the temperatures are due is taken for these."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        due = any(each.command.opcode == _TEMPERATURES for each in self._open)
        if due and frame.opcode == _SET_DEFAULT:
            frame = frame._replace(opcode=_TEMPERATURES)
        return super()._dispatch(frame, now_s)


@mutant("reads-printed-temperatures-backwards", "4.14/4", "T/9", subtle=True)
class ReadsPrintedTemperaturesBackwards(ClientCore):
    """Temperatures under 0E are told in the other order."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.opcode == _SET_DEFAULT and frame.data.count(b"|") > 1:
            frame = frame._replace(data=b"|".join(frame.data.split(b"|")[::-1]))
        return super()._dispatch(frame, now_s)
