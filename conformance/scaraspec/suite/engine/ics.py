"""Statement: what a subject claims to be (the ICS of ISO/IEC 9646), read from TOML.

Claims are verified by probing, so that a wrong one is a failure of its own; what a hook does stands
in `hooks`. A key that is not known here is an error: a misspelt claim must not be lost.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final, Self

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.readings import Dialect, ReadingError
from scaraspec.suite.engine.hooks import HOOKS, CommandHook, Hook
from scaraspec.user_message import UserMessage


class IcsError(ValueError):
    """A statement of conformance that says nothing usable; one sentence for the user."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Where and how far the arm may be moved; nothing is assumed of its geometry.

    Attributes:
        step_mm: How far a move goes from where the arm stands, along one axis.
        speed_percent: At which speed.
        box_mm: For x, y and z the least and the greatest value; empty where none was named.
        jog_s: For how long a jog may last, in seconds.
        longest_s: How long any move, reset or program may take, in seconds.
    """

    step_mm: float = 4.5
    speed_percent: int = 10
    box_mm: tuple[tuple[float, float], ...] = ()
    jog_s: float = 0.5
    longest_s: float = 60.0


@dataclass(frozen=True, slots=True)
class Ics:
    """What a subject claims.

    Attributes:
        name: What it is called.
        version: Its version.
        url: Its link, where the command line names none.
        unsupported: Commands that it does not have.
        dialect: The readings that it follows: its claims, elsewhere the defaults.
        claimed: The keys that it claims.
        network_applies: When 0x05 takes effect: ``at-once`` or ``after-restart``.
        time_scale: How many seconds of the subject pass in one of ours; a simulator may be faster.
        motion: Where the arm may be moved.
        hooks: Commands that handle the subject, by name.
    """

    name: str = ""
    version: str = ""
    url: str = ""
    unsupported: frozenset[str] = frozenset()
    dialect: Dialect = field(default_factory=lambda: Dialect({}))
    claimed: frozenset[str] = frozenset()
    network_applies: str = "at-once"
    time_scale: float = 1.0
    motion: Motion = Motion()
    hooks: Mapping[str, Hook] = field(default_factory=dict)

    @property
    def reply_s(self) -> float:
        """For how long a reply is waited for."""
        return self.dialect.seconds("reply_timeout") or 5.0

    @property
    def timing_summary(self) -> dict[str, str]:
        """The timeouts and the time scale by name, for the results."""
        return {
            "reply_timeout_s": f"{self.reply_s:g}",
            "transfer_timeout_s": f"{self.transfer_s:g}",
            "time_scale": f"{self.time_scale:g}",
        }

    @property
    def transfer_s(self) -> float:
        """After what silence a transfer is abandoned (5.4, L795)."""
        return self.dialect.seconds("xfer_timeout") or 30.0

    @property
    def undecidable_requirements(self) -> frozenset[str]:
        """What the judge cannot decide, who knows neither when 0x05 applies nor how time runs."""
        network = _ON_NETWORK if self.network_applies == "after-restart" else frozenset()
        return network | (_ON_TIME if self.time_scale != 1 else frozenset())

    @property
    def summary(self) -> dict[str, str]:
        """Its claims beside name, version and link, in the words of its file; hooks by name."""
        told = {f"readings.{key}": self.dialect[key] for key in sorted(self.claimed)}
        told |= {f"hooks.{name}": "given" for name in sorted(self.hooks)}
        if self.unsupported:
            told["lacks"] = ", ".join(sorted(self.unsupported))
        if self.network_applies != _NETWORK_APPLIES[0]:
            told["network_applies"] = self.network_applies
        if self.time_scale != 1:
            told["time_scale"] = f"{self.time_scale:g}"
        usual = Motion()
        for each in fields(Motion):
            if (value := getattr(self.motion, each.name)) != getattr(usual, each.name):
                told[f"motion.{each.name}"] = f"{value}"
        return told

    def with_claims(self, **choices: str) -> Self:
        """This statement with further claims.

        Raises:
            ReadingError: A reading does not exist.
        """
        dialect, claimed = self.dialect.replace(**choices), self.claimed | choices.keys()
        return replace(self, dialect=dialect, claimed=claimed)

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a statement.

        Raises:
            IcsError: The file cannot be read, or says something that is not known.
        """
        try:
            with path.open("rb") as file:
                said = tomllib.load(file)
        except OSError as error:
            raise IcsError(
                UserMessage("{path} cannot be read: {strerror}", path=path, strerror=error.strerror)
            ) from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise IcsError(
                UserMessage("{path} is no TOML: {error}", path=path, error=error)
            ) from None
        try:
            return cls.of(said)
        except (IcsError, ReadingError) as error:
            raise IcsError(UserMessage("{path}: {error}", path=path, error=error)) from None

    @classmethod
    def of(cls, said: Mapping[str, Any]) -> Self:
        """Make a statement of what a TOML document says.

        Raises:
            IcsError: It says something that is not known, or not of that type.
            ReadingError: It claims a reading that does not exist.
        """
        _known("", said, ("subject", "readings", "motion", "hooks"))
        subject = _table(said, "subject")
        _known("subject.", subject, _SUBJECT)
        for key, value in subject.items():
            _typed(f"subject.{key}", value, _SUBJECT[key])
        lacks = frozenset(map(str, subject.get("lacks", ())))
        if unknown := lacks - BY_NAME.keys():
            raise IcsError(
                UserMessage(
                    "subject.lacks names {unknown!r}, which is no command", unknown=min(unknown)
                )
            )
        if subject.get("network_applies", "at-once") not in _NETWORK_APPLIES:
            raise IcsError(
                UserMessage(
                    "subject.network_applies is one of {network_applies}",
                    network_applies=", ".join(_NETWORK_APPLIES),
                )
            )
        _within("subject.time_scale", subject.get("time_scale", 1.0), _FASTEST)
        readings = {k: str(v) for k, v in _table(said, "readings").items()}
        return cls(
            **{key: value for key, value in subject.items() if key != "lacks"},
            unsupported=lacks,
            dialect=Dialect(readings),
            claimed=frozenset(readings),
            motion=_motion(_table(said, "motion")),
            hooks=_hooks(_table(said, "hooks")),
        )


_SUBJECT: Final[Mapping[str, type | tuple[type, ...]]] = {
    "name": str,
    "version": str,
    "url": str,
    "lacks": list,
    "network_applies": str,
    "time_scale": (int, float),
}
_ON_NETWORK: Final = frozenset({"4.4/4"})
_ON_TIME: Final = frozenset({"4.5/4", "4.6/4", "4.9/5"})
_NETWORK_APPLIES: Final = ("at-once", "after-restart")
_FASTEST: Final = 1e4
_HOOK_S: Final = 30.0
_LONGEST_S: Final = 1e6
_AXES: Final = 3
_MOST: Final = {"step_mm": 1000.0, "speed_percent": 100.0, "jog_s": 60.0, "longest_s": _LONGEST_S}


def _table(said: Mapping[str, Any], name: str) -> dict[str, Any]:
    table = said.get(name, {})
    if not isinstance(table, dict):
        raise IcsError(UserMessage("[{name}] is a table", name=name))
    return table


def _known(where: str, said: Mapping[str, Any], keys: Any) -> None:
    for key in said:
        if key not in keys:
            raise IcsError(
                UserMessage(
                    "{where}{key} is not known: there are {keys}",
                    where=where,
                    key=key,
                    keys=", ".join(keys),
                )
            )


def _typed(name: str, value: Any, wanted: type | tuple[type, ...]) -> None:
    if not isinstance(value, wanted) or isinstance(value, bool):
        kinds = wanted if isinstance(wanted, tuple) else (wanted,)
        raise IcsError(
            UserMessage(
                "{name} is {name__}", name=name, name__=" or ".join(k.__name__ for k in kinds)
            )
        )


def _within(name: str, value: Any, most: float) -> None:
    _typed(name, value, (int, float))
    if not 0 < value <= most:  # nor is NaN
        raise IcsError(UserMessage("{name} is above 0 and at most {most:g}", name=name, most=most))


def _motion(said: Mapping[str, Any]) -> Motion:
    _known("motion.", said, [f.name for f in fields(Motion)])
    for key, most in _MOST.items():
        if key in said:
            _within(f"motion.{key}", said[key], most)
    if "speed_percent" in said:
        _typed("motion.speed_percent", said["speed_percent"], int)
    box = said.get("box_mm", [])
    _typed("motion.box_mm", box, list)
    if box and not (len(box) == _AXES and all(map(_is_range, box))):
        raise IcsError("motion.box_mm is three pairs: of x, y and z the least and the most")
    return Motion(**{**said, "box_mm": tuple((float(a), float(b)) for a, b in box)})


def _is_range(pair: object) -> bool:
    match pair:
        case [float() | int() as low, float() | int() as high]:
            return low <= high  # which NaN is not
    return False


def _hooks(said: Mapping[str, Any]) -> dict[str, CommandHook]:
    timeout_s = said.get("timeout_s", _HOOK_S)
    _within("hooks.timeout_s", timeout_s, _LONGEST_S)
    commands = {name: command for name, command in said.items() if name != "timeout_s"}
    _known("hooks.", commands, HOOKS)
    for name, command in commands.items():
        _typed(f"hooks.{name}", command, str)
    return {
        name: CommandHook(name, command, float(timeout_s)) for name, command in commands.items()
    }
