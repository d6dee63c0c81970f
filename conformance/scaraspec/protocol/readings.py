"""Readings: the open points of the document, and dialects.

Each open point is one `Reading` with its options. A `Dialect` selects one option for each open
point. This module does not define how an option affects behaviour or verdicts.
"""

import difflib
import re
import reprlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal
from enum import Enum, Flag, auto
from types import MappingProxyType
from typing import Final, Self

from scaraspec.user_message import UserMessage


class ReadingError(ValueError):
    """A key or an option does not exist; the message lists the valid ones or the closest one."""


class Binds(Enum):
    """The side whose behaviour a reading describes."""

    CONTROLLER = "controller"
    CLIENT = "client"
    BOTH = "both"


class Detectable(Flag):
    """How one can detect which option a peer follows."""

    NOT = 0
    """Not detectable from outside; the ICS must claim it."""
    ON_WIRE = auto()
    """Passively, from a capture of both directions that contains the situation."""
    BY_PROBE = auto()
    """Actively: on a controller without motion, destructive commands or undefined opcodes; on a
    client by acting as its controller.
    """
    IN_FILE = auto()
    """From the bytes of a program file."""


@dataclass(frozen=True, slots=True)
class Option:
    """One interpretation of an open point: its name on the command line and its meaning."""

    name: str
    meaning: str


@dataclass(frozen=True, slots=True)
class Reading:
    """One open point of the document.

    Attributes:
        key: The name of the open point.
        entry: The entry of the register, such as "A-4.12-1"; its middle part is the clause.
        question: What the document leaves open.
        options: The options, the default first. If there is a unit, any positive decimal number
            is also allowed.
        detectable: How the option of a peer can be detected.
        binds: The side whose behaviour it describes.
        unit: "s" for a duration in seconds, else None.
    """

    key: str
    entry: str
    question: str
    options: tuple[Option, ...]
    detectable: Detectable
    binds: Binds
    unit: str | None = None

    @property
    def default(self) -> str:
        """The name of the default option."""
        return self.options[0].name

    def check(self, choice: str) -> str:
        """Return the choice in its normal form: the name of an option, or a number such as ``0.5``.

        Raises:
            ReadingError: The choice is not allowed.
        """
        if any(choice == option.name for option in self.options):
            return choice
        if self.unit and _NUMBER.fullmatch(choice) and (number := Decimal(choice)):
            return f"{number.normalize():f}"
        allowed = [option.name for option in self.options]
        if self.unit:
            allowed.append(f"any positive number ({self.unit})")
        raise ReadingError(
            UserMessage(
                "{key} cannot be {choice}: choose {allowed}",
                key=self.key,
                choice=reprlib.repr(choice),
                allowed=" or ".join(allowed),
            )
        )


# Nine digits are 31 years; a limit prevents a number that exhausts the memory.
_NUMBER = re.compile(r"[0-9]{1,9}(\.[0-9]{1,9})?")

ON_WIRE, BY_PROBE, IN_FILE = Detectable.ON_WIRE, Detectable.BY_PROBE, Detectable.IN_FILE

_TABLE = (
    Reading(
        "prog_ext",
        "A-0-9",
        "Which extension do program names have?",
        (
            Option("any", "none is required; names made by scaraspec end in .rob"),
            Option(".rob", ".rob, as the program list prints it"),
            Option(".txt", ".txt, as the requests print it"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "err_sep",
        "A-0-2",
        "Which byte separates a failure flag from its code?",
        (
            Option("bar", "the bar 0x7C, as in every other list"),
            Option("space", "the space of the printed rows; not conforming unless it is claimed"),
        ),
        ON_WIRE,
        Binds.CONTROLLER,
    ),
    Reading(
        "max_clients",
        "A-2-2",
        "What happens to further clients while one is connected?",
        (
            Option("many", "each gets its own session"),
            Option("one", "they are refused"),
            Option("newest", "the newest client replaces the previous one"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "on_unknown",
        "A-3-9",
        "How is a frame with an unknown opcode answered?",
        (
            Option("ignore", "not at all"),
            Option("0", "with the same opcode and 0"),
            Option("close", "by closing the connection"),
        ),
        ON_WIRE,
        Binds.CONTROLLER,
    ),
    Reading(
        "resync",
        "A-3-10",
        "Where does a receiver search for the next frame after invalid bytes?",
        (
            Option("bytewise", "one byte further on"),
            Option("framewise", "after the whole invalid candidate"),
            Option("flush", "in the next bytes that arrive: the buffer is dropped"),
            Option("close", "nowhere: it closes the connection"),
        ),
        BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "partial_timeout",
        "A-3-11",
        "After how long without bytes is an unfinished frame dropped?",
        (
            Option("2", "after two seconds"),
            Option("none", "never"),
        ),
        BY_PROBE,
        Binds.BOTH,
        unit="s",
    ),
    Reading(
        "pipelining",
        "A-3-14",
        "How are requests treated that a client sends without waiting for the replies?",
        (
            Option("in-order", "answered in the order of the requests"),
            Option("one", "not supported: one request at a time"),
            Option("any-order", "answered in any order"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "reply_timeout",
        "A-3-15",
        "How long may a first reply take?",
        (Option("5", "five seconds; then the request counts as unanswered"),),
        BY_PROBE,
        Binds.BOTH,
        unit="s",
    ),
    Reading(
        "runinfo_binary",
        "A-T-1",
        "Is the result flag of the running-program reply a character or a number?",
        (
            Option("ascii", "a character, 0x30 or 0x31"),
            Option("binary", "a number, 0x00 or 0x01"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "text_encoding",
        "A-T-2",
        "How are characters of names, aliases and passwords encoded?",
        (
            Option("bytes", "taken as bytes; shown as UTF-8, else as GB18030"),
            Option("ascii", "ASCII"),
            Option("utf-8", "UTF-8"),
            Option("gb18030", "GBK or GB18030; their second bytes may equal a bar"),
        ),
        ON_WIRE | IN_FILE,
        Binds.BOTH,
    ),
    Reading(
        "trailing_nul",
        "A-T-3",
        "Does a text end in a counted NUL?",
        (
            Option("no", "no"),
            Option("yes", "yes, as in C programs"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "num_format",
        "A-T-5",
        "How are decimal numbers written?",
        (
            Option("free", "with as many digits after the point as needed, or none"),
            Option("one-decimal", "with exactly one digit after the point"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "busy_reply",
        "A-4-2",
        "How is a two-stage command answered while another one executes?",
        (
            Option("state", "refused with the current state as the code"),
            Option("silence", "not at all"),
            Option("queue", "executed afterwards; not conforming unless claimed"),
        ),
        ON_WIRE,
        Binds.CONTROLLER,
    ),
    Reading(
        "prelogin",
        "A-4-4",
        "What happens to a request before the login?",
        (
            Option("ignore", "nothing"),
            Option("failure", "it is answered with its failure form"),
            Option("close", "the connection is closed"),
            Option("reads", "read-only requests are served"),
            Option("all", "every request is served; not conforming"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "status_lag",
        "A-4.8-3",
        "How old may the status, the pose or the inputs in a reply be?",
        (Option("0", "a reply reports the state at its time"),),
        BY_PROBE,
        Binds.CONTROLLER,
        unit="s",
    ),
    Reading(
        "runinfo_none",
        "A-4.9-2",
        "How does the running-program reply report that no program runs?",
        (
            Option("0", "by the flag alone"),
            Option("0||", "with empty name and time after the flag"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "list_prefix_sep",
        "A-4.10-2",
        "Is there a bar between the flag of a program list and the first name?",
        (
            Option("0|a", "yes"),
            Option("0a", "no"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "list_cont",
        "A-4.10-3",
        "How are the further parts of a long program list sent?",
        (
            Option("push", "without further requests, one after the other"),
            Option("request", "each after another request"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "list_empty",
        "A-4.10-4",
        "How is an empty program list sent?",
        (
            Option("0", "as the flag alone"),
            Option("0|", "as the flag and a bar"),
            Option("empty", "without data"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "delete_guard",
        "A-4.11-1",
        "May a file be deleted while it runs or is transferred?",
        (
            Option("refuse", "no: the request fails"),
            Option("allow", "yes"),
        ),
        ON_WIRE,
        Binds.CONTROLLER,
    ),
    Reading(
        "op_get_default",
        "A-4.12-1",
        "Which opcode requests the default program?",
        (
            Option(
                "0x0D",
                "0x0D, as in the heading: a client tries 0x13 if there is no reply; a controller "
                "supports it; the virtual controller supports 0x13, too, and replies with the "
                "opcode of the request",
            ),
            Option(
                "0x13",
                "0x13, as printed in the rows: a client sends only this, a controller supports "
                "only this",
            ),
            Option(
                "both", "either: a client uses both, a controller replies with that of the request"
            ),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "default_none",
        "A-4.12-2",
        "What is the reply to a request for the default program if there is none?",
        (
            Option("empty", "without data"),
            Option("0", "with 0"),
            Option("silence", "not at all"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "op_temp_reply",
        "A-4.14-1",
        "Which opcode does the reply with the motor temperatures carry?",
        (
            Option("0x0F", "0x0F, as in the request; a client accepts 0x0E, too"),
            Option("0x0E", "0x0E, as printed"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "estop_interrupted",
        "A-4.17-4",
        "When is the final result of a command sent that an emergency stop interrupts?",
        (
            Option("first", "before that of the emergency stop"),
            Option("after", "after that of the emergency stop"),
            Option("none", "never"),
        ),
        ON_WIRE,
        Binds.CONTROLLER,
    ),
    Reading(
        "reset_from_error",
        "A-4.18-2",
        "Can a robot be reset in an error state?",
        (
            Option("allow", "yes"),
            Option("idle-only", "no: only if it is idle"),
        ),
        ON_WIRE,
        Binds.CONTROLLER,
    ),
    Reading(
        "theta_yz",
        "A-4.21-3",
        "How are thetaY and thetaZ treated, which have no meaning on this robot?",
        (
            Option("echo", "the home pose stores them; the tool pose reports 0"),
            Option("zero", "they are ignored, and 0 in every reply"),
            Option("reject", "values other than 0 are refused"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "pose_point",
        "A-4.23-1",
        "Which point do the tool coordinates describe?",
        (
            Option("screw-end", "the lower end of the screw"),
            Option(
                "gripper", "the working point of the gripper: the screw end plus the gripper offset"
            ),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "err_bare0",
        "A-4.24-3",
        "Does the refusal of a move contain an error code?",
        (
            Option("0|code", "yes"),
            Option("0", "no: the length is 1, as printed"),
        ),
        ON_WIRE,
        Binds.CONTROLLER,
    ),
    Reading(
        "jog_byte",
        "A-4.28-1",
        "Is the direction of a jog a character or a number?",
        (
            Option("ascii", "a client sends '1' to '4'; a controller accepts 0x01 to 0x04, too"),
            Option("binary", "a client sends 0x01 to 0x04; a controller accepts only these"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "port_pad",
        "A-4.32-1",
        "How many digits does a port number have?",
        (
            Option(
                "drawn",
                "a client sends 8 to set an output and 08 to read an input; a controller accepts "
                "both",
            ),
            Option("free", "one or two in both commands"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "port_map",
        "A-4.32-2",
        "How are ports of different kinds numbered?",
        (
            Option("per-kind", "each kind starts at 1"),
            Option("one", "all kinds together, from 1 to 40"),
        ),
        Detectable.NOT,
        Binds.BOTH,
    ),
    Reading(
        "endian",
        "A-5-2",
        "What is the byte order of numbers in file chunks and program files?",
        (
            Option("little", "the least significant byte first"),
            Option("big", "the most significant byte first"),
        ),
        ON_WIRE | BY_PROBE | IN_FILE,
        Binds.BOTH,
    ),
    Reading(
        "chunk_trunc",
        "A-5-3",
        "How long is a chunk whose buffer is not full?",
        (
            Option("full", "212 bytes; a receiver accepts both lengths"),
            Option("truncated", "cut after the last valid byte: 12 bytes and the valid bytes"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "chunk_order",
        "A-5-8",
        "Which order of chunks does a receiver accept?",
        (
            Option("ascending", "each directly after the previous one"),
            Option("any", "any"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "empty_file",
        "A-5-10",
        "How is an empty file transferred?",
        (
            Option("refused", "not at all"),
            Option("name-only", "by its name, without a chunk"),
            Option("chunk", "by its name and one chunk of length 0"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "partial_keep",
        "A-5-12",
        "What happens to the received part of an interrupted upload?",
        (
            Option("remove", "it is removed"),
            Option("keep", "it is kept and blocks its name"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "xfer_timeout",
        "A-5-13",
        "After how long without a frame does a file transfer time out?",
        (Option("30", "after thirty seconds, within 27 to 35"),),
        BY_PROBE,
        Binds.BOTH,
        unit="s",
    ),
    Reading(
        "xfer_concurrency",
        "A-5-17",
        "What happens if a second transfer is started on a connection?",
        (
            Option("refuse", "it is refused"),
            Option("replace", "it replaces the first"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "name_max",
        "A-5-20",
        "How many bytes may a file name have?",
        (
            Option("30", "30 from a sender; a receiver accepts 255"),
            Option("255", "255, the maximum of one frame"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "prog_layout",
        "A-6.1-2",
        "How are the structures of a program file aligned?",
        (
            Option("ilp32", "naturally with a long of 4 bytes: header 16, node 64"),
            Option("packed", "not at all: header 13, node 61"),
            Option("pack2", "to 2 bytes: header 14, node 62"),
            Option("lp64", "naturally with a long of 8 bytes: header 16, node 72"),
            Option("mixed", "differently in header and nodes, such as 13 and 64, or 13 and 65"),
        ),
        IN_FILE,
        Binds.BOTH,
    ),
    Reading(
        "point_meaning",
        "A-6.5-2",
        "What are the four numbers of a coordinate node?",
        (
            Option("joints", "the four joint values"),
            Option("pose", "x, y, z and thetaX"),
        ),
        ON_WIRE | IN_FILE,
        Binds.BOTH,
    ),
    Reading(
        "counts_mode",
        "A-6.5-4",
        "Which nodes does the count of a loop include?",
        (
            Option("records", "every node up to its end marker, including nested ones"),
            Option("children", "only those directly in it"),
            Option("with-end", "every node, and the end marker"),
        ),
        IN_FILE,
        Binds.BOTH,
    ),
    Reading(
        "loop_iter",
        "A-6.5-5",
        "How many times does a loop run?",
        (
            Option("endless", "until the program is stopped"),
            Option("counts", "as many times as its count"),
        ),
        ON_WIRE,
        Binds.CONTROLLER,
    ),
    Reading(
        "wait_scale",
        "A-6.5-10",
        "Which inputs does a wait node compare with 100 times the value?",
        (
            Option("all", "all; for digital inputs, 1 is accepted as well as 100"),
            Option("analog", "only analog inputs"),
        ),
        IN_FILE,
        Binds.BOTH,
    ),
    Reading(
        "cmp_result",
        "A-6.6a-1",
        "What is the purpose of the result field of a comparison?",
        (
            Option("output", "the comparison writes it at run time; a file holds 0"),
            Option("polarity", "it is the expected outcome: any number except 0 inverts it"),
        ),
        IN_FILE,
        Binds.BOTH,
    ),
    Reading(
        "assign_opt",
        "A-6.6a-2",
        "Which operator do an assignment and a port setting contain?",
        (
            Option("zero", "0: the value is A"),
            Option("any", "any, and it is ignored: the value is A"),
            Option("expression", "1 to 4: the value is A operator B"),
        ),
        IN_FILE,
        Binds.BOTH,
    ),
)

READINGS: Mapping[str, Reading] = MappingProxyType({reading.key: reading for reading in _TABLE})
"""All open points by key, in the order of the document."""


class Dialect(Mapping[str, str]):
    """One option for each open point: an immutable mapping from the key to the option's name."""

    __slots__ = ("_choices",)

    def __init__(self, choices: Mapping[str, str]) -> None:
        self._choices = {key: reading.default for key, reading in READINGS.items()}
        for key, choice in choices.items():
            self._choices[key] = _find(key).check(choice)

    @classmethod
    def of(cls, **choices: str) -> Self:
        """Return the default dialect with these choices.

        Raises:
            ReadingError: A key or an option does not exist.
        """
        return cls(choices)

    @classmethod
    def parse(cls, settings: Iterable[str]) -> Self:
        """Return the default dialect with settings ``key=option``, as on the command line.

        Raises:
            ReadingError: A setting has another form, a key is set twice, or a key or an option
                does not exist.
        """
        return cls(parse_settings(settings))

    def replace(self, **choices: str) -> Self:
        """Return this dialect with these choices.

        Raises:
            ReadingError: A key or an option does not exist.
        """
        return type(self)({**self._choices, **choices})

    def differences(self) -> dict[str, str]:
        """Return the choices that differ from the default."""
        return {key: choice for key, choice in self.items() if choice != READINGS[key].default}

    def seconds(self, key: str) -> float | None:
        """Return a duration in seconds; None if there is no timeout.

        Raises:
            ReadingError: The key does not exist or is not a duration.
        """
        if not _find(key).unit:
            raise ReadingError(UserMessage("{key} is not a duration", key=key))
        choice = self[key]
        return None if choice == "none" else float(choice)

    def __getitem__(self, key: str) -> str:
        return self._choices[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._choices)

    def __len__(self) -> int:
        return len(self._choices)

    def __hash__(self) -> int:
        return hash(tuple(self._choices.values()))

    def __repr__(self) -> str:
        choices = ", ".join(f"{key}={choice!r}" for key, choice in self.differences().items())
        return f"Dialect.of({choices})"


def parse_settings(settings: Iterable[str]) -> dict[str, str]:
    """Return the choices of settings ``key=option``; the options are not checked.

    Raises:
        ReadingError: A setting has another form, a key is set twice or does not exist.
    """
    choices: dict[str, str] = {}
    for setting in settings:
        key, equals, choice = setting.partition("=")
        if not equals:
            raise ReadingError(
                UserMessage(
                    "{setting} is not a setting: write key=option, such as endian=big",
                    setting=reprlib.repr(setting),
                )
            )
        if key in choices:
            raise ReadingError(
                UserMessage("{key} is set twice: remove one of the settings", key=key)
            )
        choices[_find(key).key] = choice
    return choices


def _find(key: str) -> Reading:
    if reading := READINGS.get(key):
        return reading
    # The time of the search grows with the text; no key has half of 40 characters.
    near = difflib.get_close_matches(key[:40], READINGS, n=1)
    hint = (
        UserMessage("did you mean {name}?", name=near[0])
        if near
        else UserMessage("the readings are {names}", names=", ".join(READINGS))
    )
    raise ReadingError(
        UserMessage("unknown reading {key}: {hint}", key=reprlib.repr(key), hint=hint)
    )


DEFAULT: Final = Dialect.of()
"""The default option of every reading, according to the register."""
