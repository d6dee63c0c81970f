"""The options of ``certify`` that the pytest plugin has, too, with their defaults and help texts.

It imports nothing: every pytest session in an environment with scaraspec loads it.
"""

from typing import Final, NamedTuple

DEFAULT_PASSWORD: Final = "password"  # noqa: S105 - the document's example (L109)
PASSWORD_SOURCE: Final = f"[SCARASPEC_PASSWORD, or '{DEFAULT_PASSWORD}']"


class Word(NamedTuple):
    """An option.

    Attributes:
        name: Its name without dashes.
        help: Its help text.
        metavar: The name of its value; None for a flag.
        default: Its default, which the help text shows; None if there is none, or if the help text
            has it already.
    """

    name: str
    help: str
    metavar: str | None = None
    default: float | None = None


WORDS: Final = {
    word.name: word
    for word in (
        Word("password", f"Password for the login over TCP {PASSWORD_SOURCE}.", "PASSWORD"),
        Word("ics", "Implementation conformance statement, TOML.", "FILE"),
        Word("reply-timeout", "Time that a first reply may take [5s].", "DURATION"),
        Word("transfer-timeout", "Silence after which the subject abandons a transfer [30].", "S"),
        Word(
            "wait-for",
            "Time to wait until the controller accepts a connection [0s].",
            "DURATION",
        ),
        Word(
            "wait-for-lock",
            "Time to wait for another run against this controller [0s].",
            "DURATION",
        ),
        Word(
            "allow",
            "Permit more than queries: state, motion, destructive; separated by commas.",
            "HAZARDS",
        ),
        Word("only", "Clauses, requirements or cases, such as 4.15,3/31.", "LIST"),
        Word(
            "require", "Requirements that must be judged; otherwise the exit status is 3.", "LIST"
        ),
        Word(
            "require-coverage",
            "Share of the requirements in scope that must be judged, such as 95%.",
            "PERCENT",
        ),
        Word("seed", "Seed of the drawn values.", "INTEGER", 0),
        Word("examples", "Number of values that a drawn case tries.", "INTEGER", 20),
        Word(
            "patience",
            "Longest wait of one case, for example for the next minute of the clock.",
            "S",
            10.0,
        ),
        Word(
            "exhaustive",
            "Run all cases, also slow ones and those of requirements that have failed.",
        ),
        Word("fail-fast", "Run no further case after one has failed."),
        Word("undefined-opcodes", "Send undefined opcodes; never to a robot that can move."),
        Word("out", "Folder for results, reports and capture.", "DIR"),
        Word(
            "state-dir",
            "Folder of the journals [SCARASPEC_STATE, or the user's state directory].",
            "DIR",
        ),
        Word("yes", "Move the robot without a confirmation."),
    )
}
"""The options by name, in the order of the help of pytest."""
