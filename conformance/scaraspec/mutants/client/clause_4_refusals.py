"""Mutants of clauses 4 and 8: refusals that are misread, and codes that are not returned."""

from collections.abc import Callable
from dataclasses import replace

from scaraspec.client.core import ClientCore, Event
from scaraspec.client.errors import ClientError, Failed, Refused
from scaraspec.client.pending_operation import PendingOperation, TwoStage
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.frames import received
from scaraspec.mutants.operators.client.messages import operations, reply_data, result_data
from scaraspec.protocol import errors
from scaraspec.protocol.commands import BY_NAME, BY_OPCODE
from scaraspec.protocol.frames import Frame

_STOP = BY_NAME["emergency_stop"].opcode  # refused without a code (L366)


def _lookup(code: bytes) -> errors.Code | None:
    return errors.lookup(code.decode("latin-1"))


def _accepted_if(condition: Callable[[Frame], bool]) -> type[ClientCore]:
    """A refused command is taken as accepted if the condition holds."""

    def change(frame: Frame) -> Frame:
        command = BY_OPCODE.get(frame.opcode)
        two_stage = command is not None and command.two_stage and not frame.tagged
        accepted = two_stage and frame.data[:1] == b"0" and condition(frame)
        return frame._replace(data=b"1") if accepted else frame

    return received(change)


row(
    "every-reply-is-yes",
    "4/13",
    "Every first reply is taken as acceptance.",
    _accepted_if(lambda _: True),
)
row(
    "bare-refusal-is-yes",
    "4/13",
    "A refusal without code is taken as acceptance.",
    _accepted_if(lambda frame: frame.data == b"0" and frame.opcode != _STOP),
    subtle=True,
)
row(
    "unknown-refusal-is-yes",
    "4/13",
    "A refusal with a code that is in no table is taken as acceptance.",
    _accepted_if(lambda frame: b"|" in frame.data and _lookup(frame.data[2:]) is None),
    subtle=True,
)
row(
    "missing-file-is-waited-for",
    "4/13",
    "A refusal with the code 20, for a missing program, is taken as acceptance.",
    _accepted_if(lambda frame: frame.data == b"0|20"),
    subtle=True,
)


@mutant("busy-behind-refusals", "4/13", subtle=True)
class BlocksRefusedCommand(ClientCore):
    """After a refusal, the same command is not sent again."""

    _refused = ""

    def is_free(self, slot: str) -> bool:
        return slot != self._refused and super().is_free(slot)

    def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
        if isinstance(operation, TwoStage) and isinstance(operation.error, Refused):
            self._refused = operation.slot
        return super()._after_step(operation, now_s)


def _errors(change: Callable[[TwoStage, ClientError], ClientError]) -> type[ClientCore]:
    """The error of a two-stage command is changed."""

    class Errors(TwoStage):
        def fail(self, error: ClientError) -> None:
            super().fail(change(self, error))

    return operations(Errors)


def _refused_as_failed(operation: TwoStage, error: ClientError) -> ClientError:
    return Failed(operation.command, error.code) if isinstance(error, Refused) else error


row(
    "refusal-is-told-as-failure",
    "4/13",
    "A refusal is reported as a failure after the start.",
    _errors(_refused_as_failed),
)

# Codes


def _codes(change: Callable[[str], str]) -> type[ClientCore]:
    """The code of a refusal or a failure is changed."""

    def with_code(_: TwoStage, error: ClientError) -> ClientError:
        if isinstance(error, Refused | Failed) and error.code is not None:
            error.code = replace(error.code, text=change(error.code.text))
        return error

    return _errors(with_code)


row(
    "codes-lose-their-zero",
    "4/12",
    "Codes are returned without leading zero.",
    _codes(lambda code: code.lstrip("0")),
)
row(
    "codes-are-told-in-decimals",
    "4/12",
    "Codes are converted from hexadecimal to decimal.",
    _codes(lambda code: f"{int(code, 16)}" if code.isalnum() else code),
)
row(
    "every-other-code-blames-motors",
    "4/12",
    "Every code that is not a motor fault is returned as a fault of all motors.",
    _codes(lambda code: code if code[:1] == "1" else "1F"),
)


@mutant("code-before-the-last", "4/12", subtle=True)
class ReturnsPreviousCode(ClientCore):
    """Each refusal or failure is reported with the code of the previous one."""

    _before: errors.Code | None = None

    def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
        error = operation.error
        if isinstance(error, Refused | Failed) and error.code is not None:
            code, error.code = error.code, self._before or error.code
            self._before = code
        return super()._after_step(operation, now_s)


def _done_if(condition: Callable[[errors.Code | None], bool]) -> type[ClientCore]:
    """A failure is taken as a success if its code satisfies the condition."""
    return result_data(
        lambda data: b"11" if data[:2] == b"00" and condition(_lookup(data[3:])) else data
    )


def _swap_wrist_and_gripper(code: str) -> str:
    known = errors.lookup(code)
    if known is None or not known.joints:
        return code
    swapped = {errors.Joint.WRIST: errors.Joint.ROTATION, errors.Joint.ROTATION: errors.Joint.WRIST}
    return errors.code_for_joints(swapped.get(joint, joint) for joint in known.joints).text


def _first_joint(data: bytes) -> bytes:
    code = _lookup(data)
    if code is None or not code.joints:
        return data
    return errors.code_for_joints(code.joints[:1]).text.encode()


row(
    "code-zero-is-success",
    "4/12",
    "A failure with the code 00 is taken as a success.",
    result_data({b"00|00": b"11"}),
    subtle=True,
)
row(
    "unknown-failure-is-success",
    "4/12",
    "A failure with a code that is in no table is taken as a success.",
    _done_if(lambda code: code is None),
    subtle=True,
)
row(
    "reserved-failure-is-success",
    "4/12",
    "A failure with a reserved code is taken as a success.",
    _done_if(lambda code: code in errors.RESERVED),
    subtle=True,
)
row(
    "wrist-is-taken-for-the-gripper",
    "8/4 4/12",
    "The bits of wrist and gripper are swapped in codes of refusals and failures.",
    _codes(_swap_wrist_and_gripper),
)
row(
    "status-mixes-up-joints",
    "8/4",
    "The bits of wrist and gripper are swapped in the status.",
    reply_data(
        "get_status",
        lambda data: _swap_wrist_and_gripper(data.decode("latin-1")).encode("latin-1"),
    ),
)
row(
    "one-joint-of-several",
    "8/4",
    "The status reports only the first of several faulty joints.",
    reply_data("get_status", _first_joint),
    subtle=True,
)

# Lower case

row(
    "small-letters-are-idle",
    "8/6",
    "A status in lower case is taken as idle.",
    reply_data("get_status", lambda data: b"00" if data != data.upper() else data),
)
row(
    "small-letters-succeed",
    "8/6",
    "A failure with a code in lower case is taken as a success.",
    result_data(lambda data: b"11" if data != data.upper() else data),
    subtle=True,
)
row(
    "small-letters-are-yes",
    "8/6",
    "A refusal with a code in lower case is taken as acceptance.",
    _accepted_if(lambda frame: frame.data != frame.data.upper()),
    subtle=True,
)
row(
    "small-letters-are-digits",
    "8/6",
    "The letter of a status in lower case is read as 0.",
    reply_data("get_status", lambda data: data[:1] + b"0" if data != data.upper() else data),
    subtle=True,
)
