"""Mutants of the text conventions: separators, bytes after the text, numbers, codes, characters."""

from collections.abc import Callable

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.connections import Crashes
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import answer_when, decoded
from scaraspec.protocol.commands import BY_NAME
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request


def _fields(command: str, change: Callable[[bytes], bytes]) -> Core:
    """The fields of first replies to a command are changed."""
    return first_reply(command, lambda data: b"|".join(map(change, data.split(b"|"))))


def _numbers(when: Callable[[float], bool]) -> Core:
    """The numbers of the gripper centre that fulfil a condition are written with an exponent."""
    return _fields(
        "get_gripper_center", lambda text: b"%.1e" % float(text) if when(float(text)) else text
    )


def _refusals(change: Callable[[bytes], bytes]) -> Core:
    """The data of first replies that are refusals with a code of two digits are changed."""
    return first_reply(
        tuple(BY_NAME),
        lambda data: change(data) if data.startswith(b"0|") and len(data) == 4 else data,
    )


def _two_bars(data: bytes) -> bytes:
    head, _, tail = data.rpartition(b"|")
    return head + b"||" + tail


def _without_sign_and_zero(text: bytes) -> bytes:
    text = text.removeprefix(b"-")
    return text[1:] if text[:2] == b"0." else text


def _has_three_decimals(_core: ControllerCore, request: Request) -> bool:
    return any(len(text.partition(b".")[2]) > 2 for text in request.frame.data.split(b"|"))


# Separators

row(
    "blanks-in-the-pose",
    "T/1",
    "The tool coordinates are separated by blanks, as printed in the document.",
    first_reply("get_tool_coordinates", lambda data: data.replace(b"|", b" ")),
)
row(
    "bars-between-blanks",
    "T/1",
    "The separators of the network settings have blanks around them.",
    first_reply("get_network", lambda data: data.replace(b"|", b" | ")),
)
row(
    "two-bars-between-temperatures",
    "T/1",
    "There are two separators between the last two temperatures.",
    first_reply("get_motor_temperatures", _two_bars),
)
row(
    "commas-between-angles",
    "T/1",
    "The joint angles are separated by commas.",
    first_reply("get_joint_angles", lambda data: data.replace(b"|", b",")),
)
row(
    "blank-before-the-code",
    "T/1",
    "The code of a refusal follows a blank, as printed in the document.",
    _refusals(lambda data: data.replace(b"|", b" ")),
)
row(
    "blanks-in-lists",
    "T/1",
    "The separators between the names of a program list are followed by blanks.",
    first_reply("list_programs", lambda data: data[:2] + data[2:].replace(b"|", b"| ")),
)

# Quotation marks and digits

row(
    "quotes-the-version",
    "T/2",
    "The version has the quotation marks of the example.",
    first_reply("get_version", lambda data: b'"' + data + b'"'),
)
row(
    "quotes-the-time",
    "T/2",
    "The time has typographic quotation marks.",
    first_reply("get_time", lambda data: "“".encode() + data + "”".encode()),
)
row(
    "quotes-addresses",
    "T/2",
    "Each address of the network settings has quotation marks.",
    _fields("get_network", lambda address: b'"' + address + b'"'),
)
row(
    "binary-flag-of-inputs",
    "T/3",
    "The flag before the digital inputs is the byte 0x01.",
    first_reply("get_digital_inputs", lambda data: bytes((data[0] - 0x30,)) + data[1:]),
)
row(
    "binary-flag-of-downloads",
    "T/3",
    "The flag in the reply to a download is a byte 0 or 1.",
    first_reply("download_name", lambda data: bytes((data[0] - 0x30,))),
)
row(
    "binary-flag-of-settings",
    "T/3",
    "The flag in the reply to a gripper centre is a byte 0 or 1.",
    first_reply("set_gripper_center", lambda data: bytes((data[0] - 0x30,))),
)
row(
    "time-in-packed-digits",
    "T/3",
    "The time is sent with two digits in each byte.",
    first_reply("get_time", lambda data: bytes.fromhex(data.decode())),
)

# Ends

row(
    "old-bytes-behind-the-version",
    "T/4",
    "The version is followed by a NUL and by old bytes of the buffer.",
    first_reply("get_version", lambda data: (data + b"\0").ljust(10, b"7")),
)
row(
    "line-end-behind-angles",
    "T/4",
    "The joint angles end with a line end.",
    first_reply("get_joint_angles", lambda data: data + b"\r\n"),
)

# Numbers

row(
    "comma-decimals",
    "T/5",
    "The tool coordinates have a comma as decimal separator.",
    first_reply(
        "get_tool_coordinates",
        lambda data: data.replace(b".", b",").replace(b"300|", b"300,0|"),
    ),
)
row(
    "exponent-of-small-numbers",
    "T/5",
    "Numbers below 0.1 are written with an exponent.",
    _numbers(lambda number: 0 < abs(number) < 0.1),
    subtle=True,
)
row(
    "exponent-of-great-numbers",
    "T/5",
    "Numbers from 100000 on are written with an exponent.",
    _numbers(lambda number: abs(number) >= 1e5),
    subtle=True,
)
row(
    "plus-signs",
    "T/5",
    "Positive joint angles have a plus sign.",
    _fields("get_joint_angles", lambda text: text if text[:1] == b"-" else b"+" + text),
)
row(
    "nothing-for-zero",
    "T/5",
    "A tool coordinate that is zero is an empty field.",
    _fields("get_tool_coordinates", lambda text: b"" if text == b"0" else text),
)
row(
    "temperature-is-no-number",
    "T/5",
    "The temperature of the last motor is nan.",
    first_reply("get_motor_temperatures", lambda data: data.rpartition(b"|")[0] + b"|nan"),
)
row(
    "no-zero-before-the-point",
    "T/5",
    "Numbers have no minus sign, and those below one begin with the decimal point.",
    _fields("get_gripper_center", _without_sign_and_zero),
)
row(
    "takes-no-three-decimals",
    "T/5",
    "A gripper centre with three decimals is refused.",
    answer_when("set_gripper_center", _has_three_decimals, value=False),
    subtle=True,
)

# Codes

row(
    "state-in-words",
    "T/7",
    "The status is a word.",
    first_reply("get_status", lambda data: b"IDLE" if data == b"00" else b"RUNNING"),
)
row(
    "codes-of-one-digit",
    "T/7",
    "The codes of refusals have no leading zero.",
    _refusals(lambda data: data.replace(b"|0", b"|")),
)
row(
    "codes-of-three-digits",
    "T/7",
    "The codes of refused runs have three digits.",
    first_reply(("run_program", "simulate_program"), lambda data: data.replace(b"|", b"|0")),
)

# Bytes outside ASCII


@mutant("dies-of-other-characters", "T/8", "3/31")
class CrashesOnOtherCharacters(Crashes):
    """The controller crashes on an upload whose name is not ASCII."""

    def upload_name(self, request: Request) -> bool:
        if not request.value.isascii():
            self.crash(request.now_s)
        return super().upload_name(request)


row(
    "stores-names-in-latin",
    "T/8 5.2/12",
    "The bytes of an uploaded file's name are stored as Latin-1 characters in UTF-8.",
    decoded("upload_name", lambda _core, _frame, name: name and name.decode("latin-1").encode()),
)
row(
    "seven-bits-of-names",
    "T/8 5.2/12",
    "The highest bit of each byte of an uploaded file's name is lost.",
    decoded(
        "upload_name", lambda _core, _frame, name: name and bytes(byte & 0x7F for byte in name)
    ),
    subtle=True,
)
