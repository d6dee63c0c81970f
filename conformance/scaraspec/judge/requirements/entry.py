"""The types of the requirement catalogue, and short names for its tables.

The ``clause_*`` modules contain the sentences. `scaraspec.judge.requirements` finds requirements by
name; other packages import the types from there.
"""

from dataclasses import KW_ONLY, dataclass
from enum import Enum, Flag, auto

from scaraspec.protocol.hazard import Hazard

LineRange = int | tuple[int, int]
"""One line of the document, or the first and the last of several, counted from 1."""


class Binds(Enum):
    """Who must fulfil a requirement."""

    CLIENT = "client"
    CONTROLLER = "controller"
    BOTH = "both"


class Method(Flag):
    """The ways to test a requirement; no flag is set if a network tool cannot test it."""

    ACTIVE_CONTROLLER = auto()
    """The tool plays the client against a controller."""
    ACTIVE_CLIENT = auto()
    """The tool plays the controller against a client."""
    PASSIVE = auto()
    """The tool reads a capture of both directions."""
    STATIC = auto()
    """The tool reads a program file."""


class Strength(Enum):
    """Which verdicts a requirement permits."""

    FIRM = "firm"
    """A violation fails."""
    TOLERANT = "tolerant"
    """Every reading that the register lists passes, and the observed reading is reported."""
    INFO = "info"
    """The document decides neither pass nor fail: the observation is recorded."""


class Basis(Enum):
    """The source of a requirement."""

    TEXT = "text"
    """The document states it in a sentence or in a frame row."""
    DERIVED = "derived"
    """It follows from another place in the document, or from a similar command."""
    ROBUSTNESS = "robustness"
    """The document does not state it, but a robust implementation does it."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """One numbered sentence of the catalogue.

    Attributes:
        id: Clause and number, for example ``"4.15/3"``.
        sentence: The required behaviour. It contains *must* if it is firm, *should* if it is
            tolerant and *expected* if it is informative.
        binds: Who must fulfil it.
        testable: How it can be tested.
        hazard: The worst effect of an active test on a real robot. A test of a capture or a file
            has no effect.
        strength: Which verdicts it permits.
        basis: Its source.
        register: The open points of the document that affect it, for example ``"A-0-2"``.
        lines: The lines of the document that state it; empty if no line does.
        original: The text of these lines in the document. ``" | "`` separates the cells of a frame
            row, ``" / "`` separates places. Empty if `lines` is empty.
    """

    id: str
    _: KW_ONLY
    sentence: str
    binds: Binds
    testable: Method
    hazard: Hazard
    strength: Strength
    basis: Basis
    register: tuple[str, ...]
    lines: tuple[LineRange, ...] = ()
    original: str = ""

    @property
    def clause(self) -> str:
        """The clause group, for example ``"4.15"``.

        ``"4"`` contains the rules for all two-stage commands, ``"T"`` the conventions of text.
        ``"6.6a"`` and ``"6.6b"`` are the two clauses with the number 6.6 in the document.
        """
        return self.id.partition("/")[0]

    @property
    def where(self) -> str:
        """The lines in the form of a citation, for example ``"L89-90, L98"``."""
        return ", ".join(
            f"L{lines}" if isinstance(lines, int) else f"L{lines[0]}-{lines[1]}"
            for lines in self.lines
        )


# Short names for the tables.
R = Requirement
CLIENT, CONTROLLER, BOTH = Binds.CLIENT, Binds.CONTROLLER, Binds.BOTH
AC, AK = Method.ACTIVE_CONTROLLER, Method.ACTIVE_CLIENT
PC, SF = Method.PASSIVE, Method.STATIC
UNTESTABLE = Method(0)
READ_ONLY, STATE = Hazard.READ_ONLY, Hazard.STATE
MOTION, DESTRUCTIVE = Hazard.MOTION, Hazard.DESTRUCTIVE
FIRM, TOLERANT, INFO = Strength.FIRM, Strength.TOLERANT, Strength.INFO
TEXT, DERIVED, ROBUSTNESS = Basis.TEXT, Basis.DERIVED, Basis.ROBUSTNESS
