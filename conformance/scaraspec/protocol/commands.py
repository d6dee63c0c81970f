"""The command table: one row for every command of clauses 4 and 5.

Codec, strategies, controller dispatch, client methods, decoder texts, dissectors and the command
reference are derived from these rows. To add a command, add a row. Behaviour is not defined here.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Final, NamedTuple

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.fields import (
    Address,
    Bits,
    Clock,
    Integer,
    Name,
    Number,
    RunTime,
    StatusCode,
    Text,
    Version,
)
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import (
    FLAG,
    Decoded,
    FinalResult,
    FirstReply,
    Jog,
    NameList,
    NoData,
    OptionalName,
    OptionalRecord,
    Payload,
    Record,
)
from scaraspec.protocol.transfer import FILE_DATA


class Network(NamedTuple):
    """Address, mask and gateway as dotted IPv4 (L150)."""

    ip: str
    mask: str
    gateway: str


class PasswordChange(NamedTuple):
    """Old and new password (L125)."""

    old: bytes
    new: bytes


class Point(NamedTuple):
    """A gripper centre, in mm (L428; A-T-8)."""

    x: float
    y: float
    z: float


class Pose(NamedTuple):
    """Tool coordinates, in mm and degrees (L447); thetaY and thetaZ have no meaning (L1006)."""

    x: float
    y: float
    z: float
    theta_x: float
    theta_y: float
    theta_z: float


class MoveTarget(NamedTuple):
    """The target of a move, and the speed in percent of full speed (L483-488)."""

    speed: int
    x: float
    y: float
    z: float
    theta_x: float
    theta_y: float
    theta_z: float


class JointValues(NamedTuple):
    """One number per joint, in the order of L299: °C in 0x0F, degrees (wrist: mm) in 0x3C."""

    inner_arm: float
    outer_arm: float
    wrist: float
    rotation: float


class RunningProgram(NamedTuple):
    """The name of the running program, and its run time in seconds (L226)."""

    name: bytes
    run_time_s: int


class PortValue(NamedTuple):
    """A digital output port and its value (L655)."""

    port: int
    value: int


_XYZ = (Number("x", "mm"), Number("y", "mm"), Number("z", "mm"))
_THETAS = (Number("theta_x", "°"), Number("theta_y", "°"), Number("theta_z", "°"))
_JOINTS = ("inner_arm", "outer_arm", "wrist", "rotation")

_NONE = NoData()
_NAME = Record((Name("name"),))
_NETWORK = Record((Address("ip"), Address("mask"), Address("gateway")), Network)
_TIME = Record((Clock("time"),))
_POINT = Record(_XYZ, Point)
_POSE = Record(_XYZ + _THETAS, Pose)
_REPLY = FirstReply()
_REPLY_WITHOUT_CODE = FirstReply(has_code=False)
_REPLY_BARE_0 = FirstReply(bare_reading="err_bare0")
_RESULT = FinalResult()


@dataclass(frozen=True, slots=True)
class Command:
    """One row of the table: the messages of a command and its hazard.

    Attributes:
        opcode: 命令字, one byte.
        name: The name of the command in methods, driver operations and reports.
        title: What the command does, in English.
        original: The heading in the document.
        clause: The clause, for example "4.15".
        lines: First and last line of the clause in the document.
        request: Data of the request.
        reply: Data of the first reply.
        result: Data of the final result, which has the 0x90 tag; None for one-stage commands.
        hazard: The worst effect on a real robot.
        initiator: The sender of the request; the controller only for 0x56 (A-5-19).
        alternate_opcode: Another opcode that the document prints for the command (A-4.12-1).
        alternate_reply_opcode: Another opcode that the document prints for the reply (A-4.14-1).
        secret: The request contains passwords, which are masked in all decoded output.
    """

    opcode: int
    name: str
    title: str
    original: str
    clause: str
    lines: tuple[int, int]
    request: Payload
    reply: Payload
    hazard: Hazard
    result: Payload | None = None
    initiator: Direction = A2C
    alternate_opcode: int | None = None
    alternate_reply_opcode: int | None = None
    secret: bool = False

    @property
    def two_stage(self) -> bool:
        """Whether a final result follows an accepting first reply (A-3-7)."""
        return self.result is not None

    def payload(self, frame: Frame) -> Payload | None:
        """Return the payload of a frame of this command; None for a tag on a one-stage command."""
        if frame.tagged:
            return self.result
        return self.request if frame.direction is self.initiator else self.reply


_RO, _ST, _MO, _DE = Hazard.READ_ONLY, Hazard.STATE, Hazard.MOTION, Hazard.DESTRUCTIVE

# fmt: off
COMMANDS: Final = (
    Command(0x01, "login", "Log in", "登录验证", "4.1", (102, 119),
            Record((Text("password", maximum_bytes=255),)), FLAG, _ST, secret=True),
    Command(0x03, "set_password", "Set a new password", "设置新密码", "4.2", (121, 141),
            Record((Text("old"), Text("new")), PasswordChange), FLAG, _DE, secret=True),
    Command(0x04, "get_network", "Get the network settings", "获取网络信息", "4.3", (143, 153),
            _NONE, _NETWORK, _RO),
    Command(0x05, "set_network", "Set the network", "设置网络", "4.4", (155, 165),
            _NETWORK, FLAG, _DE),
    Command(0x06, "set_time", "Set the clock", "设置时间", "4.5", (167, 177),
            _TIME, FLAG, _ST),
    Command(0x07, "get_time", "Get the time", "获取当前时间", "4.6", (179, 189),
            _NONE, _TIME, _RO),
    Command(0x08, "get_version", "Get the software version", "获取当前软件版本", "4.7", (191, 203),
            _NONE, Record((Version("version"),)), _RO),
    Command(0x09, "get_status", "Get the robot's status", "获取当前机器人状态", "4.8", (205, 217),
            _NONE, Record((StatusCode("code"),)), _RO),
    Command(0x0A, "get_running_program", "Get the running program", "获取当前机器人运行程序信息",
            "4.9", (219, 237), _NONE,
            OptionalRecord(Record((Name("name"), RunTime("run_time_s", "s")), RunningProgram),
                   none_reading="runinfo_none"), _RO),
    Command(0x0B, "list_programs", "List the programs", "获取用户程序列表", "4.10", (239, 251),
            _NONE, NameList(), _RO),
    Command(0x0C, "delete_program", "Delete a program", "删除用户应用程序", "4.11", (253, 263),
            _NAME, FLAG, _DE),
    Command(0x0D, "get_default_program", "Get the default program", "获取默认程序", "4.12",
            (265, 275), _NONE, OptionalName(), _RO, alternate_opcode=0x13),
    Command(0x0E, "set_default_program", "Set the default program", "设置默认程序", "4.13",
            (277, 287), _NAME, FLAG, _ST),
    Command(0x0F, "get_motor_temperatures", "Get the motor temperatures", "获取电机温度", "4.14",
            (289, 302), _NONE, Record(tuple(Number(j, "°C") for j in _JOINTS), JointValues), _RO,
            alternate_reply_opcode=0x0E),
    Command(0x30, "run_program", "Run a program", "运行程序", "4.15", (304, 328),
            _NAME, _REPLY, _MO, _RESULT),
    Command(0x31, "simulate_program", "Simulate a program", "模拟运行程序", "4.16", (330, 354),
            _NAME, _REPLY, _MO, _RESULT),
    Command(0x32, "emergency_stop", "Emergency stop", "急停命令", "4.17", (356, 383),
            _NONE, _REPLY_WITHOUT_CODE, _MO, _RESULT),
    Command(0x33, "reset", "Reset the robot", "复位机器人", "4.18", (385, 419),
            _NONE, _REPLY, _MO, _RESULT),
    Command(0x34, "get_gripper_center", "Get the gripper centre", "获取夹具中心点", "4.19",
            (421, 431), _NONE, _POINT, _RO),
    Command(0x35, "set_gripper_center", "Set the gripper centre", "设置夹具中心点", "4.20",
            (433, 443), _POINT, FLAG, _ST),
    Command(0x36, "set_initial_tool_position", "Set the initial tool position", "设置初始工具位置",
            "4.21", (445, 455), _POSE, FLAG, _ST),
    Command(0x37, "get_initial_tool_position", "Get the initial tool position", "获取初始工具位置",
            "4.22", (457, 467), _NONE, _POSE, _RO),
    Command(0x38, "get_tool_coordinates", "Get the tool coordinates", "获得工具坐标", "4.23",
            (469, 479), _NONE, _POSE, _RO),
    Command(0x39, "set_tool_coordinates", "Move to tool coordinates", "设置工具坐标", "4.24",
            (481, 516),
            Record((Integer("speed", "%", minimum=1, maximum=100), *_XYZ, *_THETAS), MoveTarget),
            _REPLY_BARE_0, _MO, _RESULT),
    Command(0x3A, "release_joints", "Release all joints", "松开所有关节", "4.25", (518, 549),
            _NONE, _REPLY, _MO, _RESULT),
    Command(0x3B, "lock_joints", "Lock all joints", "锁住所有关节", "4.26", (551, 582),
            _NONE, _REPLY, _MO, _RESULT),
    Command(0x3C, "get_joint_angles", "Get the joint angles", "获取各关节角度", "4.27", (584, 594),
            _NONE, Record(tuple(Number(j, "mm" if j == "wrist" else "°") for j in _JOINTS),
                          JointValues), _RO),
    Command(0x3D, "jog", "Jog until stopped", "持续移动机器人关节", "4.28", (596, 637),
            Jog(), _REPLY, _MO, _RESULT),
    Command(0x42, "get_digital_inputs", "Get the digital inputs", "获取某输入 IO 端口数字输入值",
            "4.31", (639, 651), _NONE, OptionalRecord(Record((Bits("bits", count=8),))), _RO),
    Command(0x43, "set_digital_output", "Set a digital output", "设置某 IO 端口数字输出值", "4.32",
            (653, 663),
            Record((Integer("port", minimum=1, maximum=40), Integer("value", maximum=1)),
                   PortValue), FLAG, _MO),
    Command(0x44, "get_analog_input", "Get an analog input", "获取某 IO 端口的输入模拟量", "4.33",
            (665, 675), Record((Integer("port", minimum=1, maximum=40, width=2),)),
            OptionalRecord(Record((Number("value"),))), _RO),
    Command(0x49, "get_digital_outputs", "Get the digital outputs", "获取某输出 IO 端口数字输入值",
            "4.34", (677, 687), _NONE, OptionalRecord(Record((Bits("bits", count=16),))), _RO),
    Command(0x60, "shutdown", "Shut the robot down", "关闭机器人", "4.35", (689, 706),
            _NONE, _REPLY, _DE),
    Command(0x50, "upload_name", "Begin an upload", "文件名传输协议", "5.2", (743, 751),
            _NAME, FLAG, _ST),
    Command(0x52, "upload_chunk", "Upload a chunk", "文件内容传输协议", "5.2", (753, 763),
            FILE_DATA, FLAG, _ST),
    Command(0x54, "download_name", "Request a download", "请求文件", "5.3", (765, 775),
            _NAME, FLAG, _RO),
    Command(0x56, "download_chunk", "Send a chunk of a download", "控制层发送文件内容", "5.3",
            (777, 787), FILE_DATA, FLAG, _RO, initiator=C2A),
)
# fmt: on

BY_NAME: Final[Mapping[str, Command]] = MappingProxyType({c.name: c for c in COMMANDS})
"""Commands by name."""

BY_OPCODE: Final[Mapping[int, Command]] = MappingProxyType(
    {c.opcode: c for c in COMMANDS}
    | {c.alternate_opcode: c for c in COMMANDS if c.alternate_opcode is not None}
)
"""Commands by opcode; 0x0D and 0x13 give the same command."""

UNDOCUMENTED_GAP: Final = range(0x3E, 0x42)
"""Four opcodes that are missing in this edition, with two clauses; they probably move (A-0-5)."""


def is_known_opcode(opcode: int, tagged: bool) -> bool:  # noqa: FBT001 - a resync filter has these two
    """Return whether a frame may have this opcode and tag, in either direction.

    Pass this function to a `Framer` as its resync or recovery filter.
    """
    command = BY_OPCODE.get(opcode)
    return command is not None and (command.two_stage or not tagged)


class Parsed(NamedTuple):
    """A frame decoded with the table: its command, the part of the exchange, and the payload."""

    command: Command
    part: str  # "request", "reply" or "result"
    decoded: Decoded


_KNOWN_FRAMES: Final = 1024
"""Distinct frames that are kept: polling clients repeat the same frames."""


@lru_cache(maxsize=_KNOWN_FRAMES)
def read_frame(direction: Direction, data: bytes) -> tuple[Frame, Parsed | None]:
    """Decode the bytes of a frame without a tag.

    Args:
        direction: The sender.
        data: Exactly one frame, from its start byte to its end byte.
    """
    frame = Frame(direction, data[1], data[3:-1])
    return frame, parse_frame(frame)


@lru_cache(maxsize=_KNOWN_FRAMES)
def parse_frame(frame: Frame) -> Parsed | None:
    """Decode a frame by its own opcode, without regard to earlier requests.

    A reply to 0x0F with the opcode 0x0E (A-4.14-1) is recognized by its four fields. The results
    are cached, because polling clients repeat the same frames.

    Returns:
        None for an undefined opcode, and for a tag on a one-stage command.
    """
    command = BY_OPCODE.get(frame.opcode)
    if (
        command is not None
        and frame.direction is C2A
        and not frame.tagged
        and frame.opcode == BY_NAME["get_motor_temperatures"].alternate_reply_opcode
        and frame.data.count(b"|") == len(_JOINTS) - 1
    ):
        command = BY_NAME["get_motor_temperatures"]
    payload = command.payload(frame) if command else None
    if command is None or payload is None:
        return None
    part = (
        "result" if frame.tagged else "request" if frame.direction is command.initiator else "reply"
    )
    return Parsed(command, part, payload.decode(frame.data))
