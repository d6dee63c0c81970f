"""Mutants of clause T: numbers, bits, names, times, codes and outcomes that a client returns."""

from typing import Any

from scaraspec.client.aio import AsyncClient
from scaraspec.client.errors import ClientError, ProtocolError
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.client.results import RunningProgram
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.frames import received
from scaraspec.mutants.operators.client.messages import (
    loss_is_success,
    refusal_returns,
    reply_data,
    result_data,
    returned,
)
from scaraspec.protocol.commands import BY_OPCODE, JointValues, PortValue
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import FLAG

# Numbers


def _with_decimals(data: bytes) -> bytes:
    return data if all(b"." in text for text in data.split(b"|")) else b""


def _rounded(data: bytes) -> bytes:
    return b"|".join(b"%d" % round(float(text)) for text in data.split(b"|"))


def _one_decimal(data: bytes) -> bytes:
    return b"|".join(text[: text.find(b".") + 2 or None] for text in data.split(b"|"))


def _arms_swapped(data: bytes) -> bytes:
    inner, outer, *others = data.split(b"|")
    return b"|".join((outer, inner, *others))


row(
    "loses-the-minus",
    "T/9",
    "Negative joint angles are returned as positive ones.",
    reply_data("get_joint_angles", lambda data: data.replace(b"-", b"")),
)
row(
    "rounds-coordinates",
    "T/9",
    "The gripper center is rounded to whole numbers.",
    reply_data("get_gripper_center", _rounded),
)
row(
    "minus-only-ahead-of-wholes",
    "T/9",
    "A tool coordinate between -1 and 0 loses its sign.",
    reply_data("get_tool_coordinates", lambda data: data.replace(b"-0.", b"0.")),
    subtle=True,
)
row(
    "wants-decimals",
    "T/5",
    "Joint angles without decimals cannot be read.",
    reply_data("get_joint_angles", _with_decimals),
    subtle=True,
)
row(
    "reads-one-decimal",
    "T/5 T/9",
    "Only the first decimal of each joint angle is read.",
    reply_data("get_joint_angles", _one_decimal),
    subtle=True,
)
row(
    "swaps-joints",
    "T/9",
    "The temperatures of the two arms are swapped.",
    reply_data("get_motor_temperatures", _arms_swapped),
)
row(
    "reverses-bits",
    "T/9",
    "The digital inputs are returned with the lowest port first.",
    returned("get_digital_inputs", lambda bits: bits[::-1]),
)
row(
    "drops-leading-zeros",
    "T/9",
    "The digital outputs are returned without leading zeros.",
    returned("get_digital_outputs", lambda bits: bits.lstrip("0")),
    subtle=True,
)
row(
    "no-value-is-zero",
    "T/9",
    "An analog input that cannot be read is returned as 0.",
    refusal_returns("get_analog_input", 0.0),
)

# Times

row(
    "forgets-days",
    "T/9",
    "Only hours, minutes and seconds of a run time are read.",
    reply_data(
        "get_running_program",
        lambda data: data[:-8] + b"00" + data[-6:] if len(data) > 8 else data,
    ),
    subtle=True,
)
row(
    "windows-years",
    "T/9",
    "Only two digits of a year are read, and 70 to 99 mean the last century.",
    reply_data("get_time", lambda data: (b"19" if data[2:4] >= b"70" else b"20") + data[2:]),
    subtle=True,
)
row(
    "minutes-for-months",
    "T/9",
    "The month is returned in place of the minute.",
    reply_data("get_time", lambda data: data[:10] + data[4:6] + data[12:]),
)

# Names


def _running_name_cut(data: bytes) -> bytes:
    flag, bar, rest = data.partition(b"|")
    name, *time = rest.split(b"|")
    return flag + bar + b"|".join((name[:30], *time))


row(
    "cuts-the-running-name",
    "T/9",
    "The name of the running program is cut to 30 bytes.",
    reply_data("get_running_program", _running_name_cut),
    subtle=True,
)
row(
    "running-for-nothing",
    "T/9",
    "If no program runs, a program with the name - is returned.",
    reply_data("get_running_program", {b"0": b"1|-|00000000"}),
)
row(
    "empty-fields-are-program",
    "T/9",
    "A reply with empty fields, which means no program, is returned as a program.",
    reply_data("get_running_program", {b"0||": b"1|-|00000000"}),
    subtle=True,
)
row(
    "cuts-the-default-name",
    "T/9",
    "The name of the default program is returned without its extension.",
    reply_data("get_default_program", lambda data: data.partition(b".")[0]),
)
row(
    "no-default-is-main",
    "T/9",
    "If no default program is set, main.rob is returned.",
    reply_data("get_default_program", {b"": b"main.rob", b"0": b"main.rob"}),
    subtle=True,
)

# Outcomes and codes


def _always_yes(frame: Frame) -> Frame:
    command = BY_OPCODE.get(frame.opcode)
    setting = command is not None and command.reply is FLAG and command.name != "login"
    no = setting and frame.data == b"0" and not frame.tagged
    return frame._replace(data=b"1") if no else frame


row(
    "every-flag-is-yes",
    "T/9",
    "A refused setting is reported as done.",
    received(_always_yes),
)


@mutant("outputs-always-set", "T/9", subtle=True)
class IgnoresOutputReplies(AsyncClient):
    """The setting of an output is reported as done, whatever the reply."""

    async def set_digital_output(self, port: int, value: int) -> None:
        await self._settled(self._core.command("set_digital_output", PortValue(port, value)))

    async def _settled(self, operation: PendingOperation) -> None:
        await self.wait_for(lambda: self._core.is_free(operation.slot))
        self._core.begin(operation, 0.0)
        self._update()
        await self.wait_for(lambda: operation.settled)


@mutant("knows-what-it-has-set", "T/9", subtle=True)
class CachesDefaultProgram(AsyncClient):
    """The default program that was set is returned from memory without a request."""

    _set: str | None = None

    async def set_default_program(self, name: Any) -> None:
        await super().set_default_program(name)
        self._set = name

    async def get_default_program(self) -> str | None:
        return self._set or await super().get_default_program()


@mutant("knows-what-it-runs", "T/9", subtle=True)
class CachesRunningProgram(AsyncClient):
    """The program that the client started is returned as the running one without a request."""

    _runs: str | None = None

    async def run_program(self, name: Any) -> None:
        self._runs = name
        try:
            await super().run_program(name)
        finally:
            self._runs = None

    async def get_running_program(self) -> RunningProgram | None:
        return RunningProgram(self._runs, 1) if self._runs else await super().get_running_program()


@mutant("nonsense-is-the-last-word", "T/9", subtle=True)
class GivesUpTemperatures(AsyncClient):
    """After a reply that cannot be read, the temperatures are not requested again."""

    _unread = False

    async def get_motor_temperatures(self) -> JointValues:
        if self._unread:
            raise ClientError("the temperatures cannot be read")
        try:
            return await super().get_motor_temperatures()
        except ProtocolError:
            self._unread = True
            raise


@mutant("sets-outputs-once", "T/9", subtle=True)
class SetsOutputsOnce(AsyncClient):
    """An output is not set to its last value again, and the setting is reported as done."""

    _last: tuple[int, int] | None = None

    async def set_digital_output(self, port: int, value: int) -> None:
        if self._last != (port, value):
            await super().set_digital_output(port, value)
            self._last = port, value


def _in_decimal_digits(frame: Frame) -> Frame:
    head, bar, code = frame.data.rpartition(b"|")
    if head in (b"0", b"00") and len(code) == 2 and not code.isdigit():
        return frame._replace(data=head + bar + code[:1] + b"0")
    return frame


row(
    "takes-loss-for-deletion",
    "T/9",
    "A deletion that was not answered before the link was lost is reported as done.",
    loss_is_success("delete_program"),
    subtle=True,
)
row(
    "takes-loss-for-new-password",
    "T/9",
    "A new password that was not answered before the link was lost is reported as set.",
    loss_is_success("set_password"),
    subtle=True,
)
row(
    "failures-are-done",
    "T/9",
    "A command whose final result is a failure is reported as done.",
    result_data(lambda data: b"11" if data.startswith(b"00|") else data),
)
row(
    "codes-are-decimal",
    "T/9",
    "The second digit of a code that is not decimal is read as 0.",
    received(_in_decimal_digits),
    subtle=True,
)

# Beyond ASCII

row(
    "question-marks",
    "T/8",
    "Each byte of a listed name that is not ASCII is returned as a question mark.",
    reply_data(
        "list_programs", lambda data: bytes(byte if byte < 0x80 else ord("?") for byte in data)
    ),
)
row(
    "leaves-out-the-foreign",
    "T/8",
    "Each byte of a listed name that is not ASCII is dropped.",
    reply_data("list_programs", lambda data: bytes(byte for byte in data if byte < 0x80)),
    subtle=True,
)
