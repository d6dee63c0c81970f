"""The form of one entry of the requirement catalogue, and the short words of its tables.

Only types live here. The sentences are in the table modules beside this one; looking them up is
the business of ``scaraspec.judge.requirements``, from where the types are imported elsewhere.
"""

from dataclasses import KW_ONLY, dataclass
from enum import Enum, Flag, auto

from scaraspec.protocol.hazard import Hazard

LineRange = int | tuple[int, int]
"""One line of the document, or the first and the last of several, counted from 1."""


class Binds(Enum):
    """Whose duty a requirement is."""

    CLIENT = "client"
    CONTROLLER = "controller"
    BOTH = "both"


class Method(Flag):
    """The ways in which a requirement can be decided; none where a network tool cannot do it."""

    ACTIVE_CONTROLLER = auto()
    """The tool plays the client against a controller."""
    ACTIVE_CLIENT = auto()
    """The tool plays the controller against a client."""
    PASSIVE = auto()
    """The tool reads a capture of both directions."""
    STATIC = auto()
    """The tool reads a program file."""


class Strength(Enum):
    """How hard the verdict on a requirement may be."""

    FIRM = "firm"
    """Doing otherwise fails."""
    TOLERANT = "tolerant"
    """Every reading that the register lists passes, and the one seen is reported."""
    INFO = "info"
    """No pass or fail follows from the document: what was seen is recorded."""


class Basis(Enum):
    """Where a requirement comes from."""

    TEXT = "text"
    """The document says it, or draws it in a frame row."""
    DERIVED = "derived"
    """It follows from what the document says elsewhere, or of a sister command."""
    ROBUSTNESS = "robustness"
    """The document is silent; a sound peer does it all the same."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """One numbered sentence of the catalogue.

    Attributes:
        id: Clause and number, for example ``"4.15/3"``.
        sentence: What is required. It says *must* where it is firm, *should* where it is tolerant
            and *expected* where it is informative.
        binds: Whose duty it is.
        testable: How it can be decided.
        hazard: The worst that provoking the situation can do to a real robot; deciding it from a
            capture or a file does nothing.
        strength: How hard the verdict may be.
        basis: Where it comes from.
        register: The open points of the document that bear on it, for example ``"A-0-2"``.
        lines: The lines of the document it rests on; empty where the document is silent.
        original: The document's own words from those lines, a frame row with ``" | "`` between its
            cells, and ``" / "`` between one place and the next; empty where `lines` is.
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

        ``"4"`` is what all two-stage commands share, ``"T"`` the conventions of text, ``"6.6a"``
        and ``"6.6b"`` are the two clauses that the document numbers 6.6.
        """
        return self.id.partition("/")[0]

    @property
    def where(self) -> str:
        """The lines as they are cited, for example ``"L89-90, L98"``."""
        return ", ".join(
            f"L{lines}" if isinstance(lines, int) else f"L{lines[0]}-{lines[1]}"
            for lines in self.lines
        )


# The vocabulary of the tables: short, so that a requirement stays one paragraph.
R = Requirement
CLIENT, CONTROLLER, BOTH = Binds.CLIENT, Binds.CONTROLLER, Binds.BOTH
AC, AK = Method.ACTIVE_CONTROLLER, Method.ACTIVE_CLIENT
PC, SF = Method.PASSIVE, Method.STATIC
UNTESTABLE = Method(0)
READ_ONLY, STATE = Hazard.READ_ONLY, Hazard.STATE
MOTION, DESTRUCTIVE = Hazard.MOTION, Hazard.DESTRUCTIVE
FIRM, TOLERANT, INFO = Strength.FIRM, Strength.TOLERANT, Strength.INFO
TEXT, DERIVED, ROBUSTNESS = Basis.TEXT, Basis.DERIVED, Basis.ROBUSTNESS
