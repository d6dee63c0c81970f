"""Readings: the points that the document leaves open, and the dialect that settles them all.

Each open point is met once, as a `Reading` with its options; a `Dialect` chooses one option of
every reading. What a choice does to behaviour or to a verdict is decided where it is used.
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
    """A reading was named or chosen that does not exist; the message says which ones do."""


class Binds(Enum):
    """Whose behaviour a reading describes."""

    CONTROLLER = "controller"
    CLIENT = "client"
    BOTH = "both"


class Detectable(Flag):
    """How it can be found out which option a peer follows."""

    NOT = 0
    """Not from outside: it has to be claimed, or is unobservable."""
    ON_WIRE = auto()
    """Passively, from a capture of both sides in which the situation occurs."""
    BY_PROBE = auto()
    """Actively: on a controller without motion, destruction or undefined opcodes; on a client by
    playing its controller.
    """
    IN_FILE = auto()
    """From the bytes of a program file."""


@dataclass(frozen=True, slots=True)
class Option:
    """One plausible meaning of an open point: its name on the command line, and what it is."""

    name: str
    meaning: str


@dataclass(frozen=True, slots=True)
class Reading:
    """One open point of the document.

    Attributes:
        key: Its name.
        entry: The register's entry ("A-4.12-1"); its middle part is the clause.
        question: What the document leaves open.
        options: The answers, the default first. A reading with a unit takes any positive decimal
            number besides these.
        detectable: How the answer shows.
        binds: Whose behaviour it describes.
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
        """The name of the option that holds unless another one is chosen."""
        return self.options[0].name

    def check(self, choice: str) -> str:
        """The choice in its one spelling: an option's name, or a number such as ``0.5``.

        Raises:
            ReadingError: It is neither.
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


# Nine digits are 31 years; more would only serve to exhaust memory.
_NUMBER = re.compile(r"[0-9]{1,9}(\.[0-9]{1,9})?")

ON_WIRE, BY_PROBE, IN_FILE = Detectable.ON_WIRE, Detectable.BY_PROBE, Detectable.IN_FILE

_TABLE = (
    Reading(
        "prog_ext",
        "A-0-9",
        "Which extension do the names of programs bear?",
        (
            Option("any", "none is required; what we make ourselves ends in .rob"),
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
            Option(
                "space", "the blank of the printed rows; not conforming unless chosen on purpose"
            ),
        ),
        ON_WIRE,
        Binds.CONTROLLER,
    ),
    Reading(
        "max_clients",
        "A-2-2",
        "What happens to further clients while one is connected?",
        (
            Option("many", "they are served as sessions of their own"),
            Option("one", "they are refused"),
            Option("newest", "the newest displaces the one before"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "on_unknown",
        "A-3-9",
        "How is a frame answered whose opcode is unknown?",
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
        "Where does a receiver look for the next frame after bytes that form none?",
        (
            Option("bytewise", "one byte further on"),
            Option("framewise", "behind the whole bad candidate"),
            Option("flush", "in what arrives next: everything buffered is dropped"),
            Option("close", "nowhere: it closes the connection"),
        ),
        BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "partial_timeout",
        "A-3-11",
        "After how long a silence is an unfinished frame given up?",
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
        "How are requests treated that follow each other without waiting for the replies?",
        (
            Option("in-order", "answered in the order of the requests"),
            Option("one", "not at all: one request at a time"),
            Option("any-order", "answered in any order"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "reply_timeout",
        "A-3-15",
        "How long may a first reply take?",
        (Option("5", "five seconds, then the request counts as unanswered"),),
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
            Option("gb18030", "GBK or GB18030, whose second bytes may equal a bar"),
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
            Option("yes", "yes, as C programs send it"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "num_format",
        "A-T-5",
        "How are decimal numbers written?",
        (
            Option("free", "with as many decimals as needed, or none"),
            Option("one-decimal", "with exactly one decimal"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "busy_reply",
        "A-4-2",
        "How is a two-stage command answered while another one executes?",
        (
            Option("state", "refused with the present state as the code"),
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
        "runinfo_none",
        "A-4.9-2",
        "How does the running-program reply say that none runs?",
        (
            Option("0", "by the flag alone"),
            Option("0||", "with empty name and time behind the flag"),
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
        "How do the further parts of a long program list arrive?",
        (
            Option("push", "unasked, one after the other"),
            Option("request", "each on another request"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "list_empty",
        "A-4.10-4",
        "How is an empty program list sent?",
        (
            Option("0", "as its flag alone"),
            Option("0|", "as its flag and a bar"),
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
        "Which opcode asks for the default program?",
        (
            Option(
                "0x0D",
                "0x0D, as headed: a client tries 0x13 where it stays unanswered; a controller "
                "serves it, and the virtual one 0x13 too, answering with the one it was asked",
            ),
            Option(
                "0x13",
                "0x13, as printed in the rows: a client asks with nothing else, a controller "
                "serves nothing else",
            ),
            Option(
                "both", "either: a client uses both, a controller answers with the one it was asked"
            ),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "default_none",
        "A-4.12-2",
        "How is the question for the default program answered when there is none?",
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
            Option("0x0F", "0x0F, that of its request; a client takes 0x0E as well"),
            Option("0x0E", "0x0E, as printed"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "estop_interrupted",
        "A-4.17-4",
        "When does a command that the emergency stop interrupts get its own final result?",
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
        "Can a robot in error be reset?",
        (
            Option("allow", "yes"),
            Option("idle-only", "no: an idle one only"),
        ),
        ON_WIRE,
        Binds.CONTROLLER,
    ),
    Reading(
        "theta_yz",
        "A-4.21-3",
        "What becomes of thetaY and thetaZ, which mean nothing on this robot?",
        (
            Option("echo", "the home pose keeps them; the tool pose reports 0"),
            Option("zero", "ignored, and 0 in every reply"),
            Option("reject", "values other than 0 are refused"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "pose_point",
        "A-4.23-1",
        "Which point do the tool coordinates give?",
        (
            Option("screw-end", "the lower end of the screw"),
            Option(
                "gripper", "the gripper's working point: the screw's end plus the gripper offset"
            ),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "err_bare0",
        "A-4.24-3",
        "Does the refusal of a move carry its code?",
        (
            Option("0|code", "yes"),
            Option("0", "no: its length is 1, as printed"),
        ),
        ON_WIRE,
        Binds.CONTROLLER,
    ),
    Reading(
        "jog_byte",
        "A-4.28-1",
        "Is the direction of a jog a character or a number?",
        (
            Option("ascii", "a client sends '1' to '4'; a controller takes these and 0x01 to 0x04"),
            Option("binary", "a client sends 0x01 to 0x04; a controller takes only these"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "port_pad",
        "A-4.32-1",
        "With how many digits is a port number written?",
        (
            Option(
                "drawn",
                "a client sends 8 when setting and 08 when reading; a controller takes both",
            ),
            Option("free", "one or two in either command"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "port_map",
        "A-4.32-2",
        "How are the ports of the different kinds numbered?",
        (
            Option("per-kind", "each kind from 1"),
            Option("one", "all together, from 1 to 40"),
        ),
        Detectable.NOT,
        Binds.BOTH,
    ),
    Reading(
        "endian",
        "A-5-2",
        "In which byte order are the numbers in file chunks and program files?",
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
            Option("full", "sent with all 212 bytes; a receiver takes both"),
            Option("truncated", "cut behind its last valid byte: 12 bytes and the valid ones"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.BOTH,
    ),
    Reading(
        "chunk_order",
        "A-5-8",
        "Which order of chunks does a receiver take?",
        (
            Option("ascending", "each directly behind the one before"),
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
        "What becomes of the part received before an upload broke off?",
        (
            Option("remove", "it is removed"),
            Option("keep", "it stays and blocks its name"),
        ),
        ON_WIRE | BY_PROBE,
        Binds.CONTROLLER,
    ),
    Reading(
        "xfer_timeout",
        "A-5-13",
        "After how long a silence is a file transfer given up?",
        (Option("30", "after thirty seconds, within 27 to 35"),),
        BY_PROBE,
        Binds.BOTH,
        unit="s",
    ),
    Reading(
        "xfer_concurrency",
        "A-5-17",
        "What happens when a second transfer is begun on a connection?",
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
            Option("30", "30 from a sender; a receiver takes 255"),
            Option("255", "255, what one frame holds"),
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
            Option("mixed", "differently in header and nodes, such as 13 and 64 or 13 and 65"),
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
            Option("records", "every node up to its end marker, nested ones too"),
            Option("children", "only those directly in it"),
            Option("with-end", "every node, and the end marker"),
        ),
        IN_FILE,
        Binds.BOTH,
    ),
    Reading(
        "loop_iter",
        "A-6.5-5",
        "How often does a loop run?",
        (
            Option("endless", "until the program is stopped"),
            Option("counts", "as often as its count says"),
        ),
        ON_WIRE,
        Binds.CONTROLLER,
    ),
    Reading(
        "wait_scale",
        "A-6.5-10",
        "Which inputs does a wait node compare with 100 times the value?",
        (
            Option("all", "all; a digital 1 is taken as well as 100"),
            Option("analog", "analog ones only"),
        ),
        IN_FILE,
        Binds.BOTH,
    ),
    Reading(
        "cmp_result",
        "A-6.6a-1",
        "What is the result field of a comparison for?",
        (
            Option("output", "the comparison writes it at run time; a file holds 0"),
            Option("polarity", "it names the expected outcome: any other number than 0 inverts"),
        ),
        IN_FILE,
        Binds.BOTH,
    ),
    Reading(
        "assign_opt",
        "A-6.6a-2",
        "Which operator do an assignment and a port setting hold?",
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
"""Every open point by its key, in the order of the document."""


class Dialect(Mapping[str, str]):
    """One option for every reading: an immutable mapping from key to the option's name."""

    __slots__ = ("_choices",)

    def __init__(self, choices: Mapping[str, str]) -> None:
        self._choices = {key: reading.default for key, reading in READINGS.items()}
        for key, choice in choices.items():
            self._choices[key] = _find(key).check(choice)

    @classmethod
    def of(cls, **choices: str) -> Self:
        """The default dialect but for these choices.

        Raises:
            ReadingError: A key or an option does not exist.
        """
        return cls(choices)

    @classmethod
    def parse(cls, settings: Iterable[str]) -> Self:
        """The default dialect but for settings written ``key=option``, as on a command line.

        Raises:
            ReadingError: A setting is not of that form, or names a key twice or one that does not
                exist, or an option that does not exist.
        """
        choices: dict[str, str] = {}
        for setting in settings:
            key, equals, choice = setting.partition("=")
            if not equals:
                raise ReadingError(
                    UserMessage(
                        "{setting} is no setting: write key=option, such as endian=big",
                        setting=reprlib.repr(setting),
                    )
                )
            if key in choices:
                raise ReadingError(UserMessage("{key} is set twice: keep one of the two", key=key))
            choices[_find(key).key] = choice
        return cls(choices)

    def replace(self, **choices: str) -> Self:
        """This dialect but for these choices.

        Raises:
            ReadingError: A key or an option does not exist.
        """
        return type(self)({**self._choices, **choices})

    def differences(self) -> dict[str, str]:
        """The choices that are not the default ones."""
        return {key: choice for key, choice in self.items() if choice != READINGS[key].default}

    def seconds(self, key: str) -> float | None:
        """A duration in seconds; None where the choice is never to time out.

        Raises:
            ReadingError: The key does not exist or is no duration.
        """
        if not _find(key).unit:
            raise ReadingError(UserMessage("{key} is no duration", key=key))
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


def _find(key: str) -> Reading:
    if reading := READINGS.get(key):
        return reading
    # The search takes time in proportion to the text, and no key is half as long as this.
    near = difflib.get_close_matches(key[:40], READINGS, n=1)
    hint = f"did you mean {near[0]}?" if near else f"they are {', '.join(READINGS)}"
    raise ReadingError(
        UserMessage("there is no reading {key}: {hint}", key=reprlib.repr(key), hint=hint)
    )


DEFAULT: Final = Dialect.of()
"""The register's default for every reading."""
