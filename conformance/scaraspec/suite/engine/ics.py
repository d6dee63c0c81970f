"""ICS: the implementation conformance statement of a subject (ISO/IEC 9646), read from TOML.

Probes verify the claims, and a wrong claim is a failure. `hooks` describes the hooks. An unknown
key is an error, so that a misspelt claim is not ignored.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final, Self

from scaraspec.judge.scope import Scope
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.readings import Dialect, ReadingError
from scaraspec.suite.engine.hooks import HOOKS, CommandHook, Hook, HookError
from scaraspec.user_message import UserMessage, sentence_of


class IcsError(ValueError):
    """The ICS is invalid or cannot be read; the message is one sentence."""


class UnreadableIcsError(IcsError):
    """The file cannot be read, or is not TOML; the message names it."""


def read_document(path: Path) -> dict[str, Any]:
    """Read the TOML document of an ICS, without a check of its content.

    Raises:
        UnreadableIcsError: The file cannot be read, or is not TOML.
    """
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except OSError as error:
        raise UnreadableIcsError(
            UserMessage("{path} cannot be read: {strerror}", path=path, strerror=error.strerror)
        ) from None
    except (ValueError, RecursionError) as error:  # also no UTF-8, and too large a number
        raise UnreadableIcsError(
            UserMessage("{path} is not valid TOML: {error}", path=path, error=error)
        ) from None


@dataclass(frozen=True, slots=True)
class Motion:
    """How far the arm may be moved. The suite assumes nothing about its geometry.

    Attributes:
        step_mm: The length of a move from the current pose, along one axis.
        speed_percent: The speed of a move.
        box_mm: The minimum and maximum of x, y and z; empty for no limits.
        jog_s: The maximum duration of a jog, in seconds.
        longest_s: The maximum duration of any move, reset or program, in seconds of the subject.
    """

    step_mm: float = 4.5
    speed_percent: int = 10
    box_mm: tuple[tuple[float, float], ...] = ()
    jog_s: float = 0.5
    longest_s: float = 60.0


@dataclass(frozen=True, slots=True)
class Ics:
    """The claims of a subject.

    Attributes:
        name: Its name.
        version: Its version.
        url: Its link; used if the command line names none.
        unsupported: The commands that it does not support.
        dialect: The readings that it follows: its claims, and the defaults for all other keys.
        claimed: The keys of the readings that it claims.
        network_applies: When 0x05 takes effect: ``at-once`` or ``after-restart``.
        time_scale: How many seconds of the subject's clock pass in one second; a simulator may be
            faster than real time.
        motion: How far the arm may be moved.
        hooks: The hooks by name.
        sample: The serial number, firmware and hardware of the tested device.
        laboratory: The laboratory and the operator.
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
    sample: Mapping[str, str] = field(default_factory=dict)
    laboratory: Mapping[str, str] = field(default_factory=dict)

    @property
    def reply_s(self) -> float:
        """The reply timeout in seconds."""
        return float(self.dialect["reply_timeout"])

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
        """The silence after which the subject aborts a transfer, in seconds (5.4, L795)."""
        return float(self.dialect["xfer_timeout"])

    @property
    def undecidable_requirements(self) -> frozenset[str]:
        """The requirements that the judge cannot decide for this subject.

        The judge does not know when 0x05 takes effect and how fast the subject's clock runs.
        """
        network = _ON_NETWORK if self.network_applies == "after-restart" else frozenset()
        return network | (_ON_TIME if self.time_scale != 1 else frozenset())

    def scope(self, side: Direction | None) -> Scope:
        """Return what is judged if the subject sends in this direction; None for both sides."""
        return Scope(side, self.undecidable_requirements, self.unsupported)

    @property
    def recorded(self) -> dict[str, str]:
        """The claims that the judge of a recording needs, as text; see `of_recording`."""
        claims = {
            key: value
            for key, value in self.summary.items()
            if not key.startswith(("motion.", "hooks."))
        }
        return {**claims, "time_scale": f"{self.time_scale}"}

    @classmethod
    def of_recording(cls, claims: Mapping[str, str]) -> Self:
        """Build an ICS from the claims in a recording, the inverse of `recorded`.

        Raises:
            IcsError: A claim is unknown, or its value is invalid.
        """
        subject: dict[str, Any] = dict(claims)
        readings = {key: subject.pop(key) for key in claims if key.startswith(_READING)}
        if "lacks" in claims:
            subject["lacks"] = claims["lacks"].split(", ")
        try:
            subject["time_scale"] = float(claims.get("time_scale", "1"))
            return cls.of(
                {
                    "subject": subject,
                    "readings": {key.removeprefix(_READING): readings[key] for key in readings},
                }
            )
        except ValueError as error:  # also an invalid claim
            raise IcsError(sentence_of(error)) from None

    @property
    def summary(self) -> dict[str, str]:
        """The claims as in the file, without name, version and link; of hooks only the names."""
        claims = {f"{_READING}{key}": self.dialect[key] for key in sorted(self.claimed)}
        claims |= {f"hooks.{name}": "given" for name in sorted(self.hooks)}
        if self.unsupported:
            claims["lacks"] = ", ".join(sorted(self.unsupported))
        if self.network_applies != _NETWORK_APPLIES[0]:
            claims["network_applies"] = self.network_applies
        if self.time_scale != 1:
            claims["time_scale"] = f"{self.time_scale:g}"
        default = Motion()
        for each in fields(Motion):
            if (value := getattr(self.motion, each.name)) != getattr(default, each.name):
                claims[f"motion.{each.name}"] = f"{value}"
        return claims

    def with_claims(self, **choices: str) -> Self:
        """Return this ICS with further claims.

        Raises:
            ReadingError: A reading does not exist.
        """
        dialect, claimed = self.dialect.replace(**choices), self.claimed | choices.keys()
        return replace(self, dialect=dialect, claimed=claimed)

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read an ICS from a file.

        Raises:
            IcsError: The file cannot be read, or is not a valid ICS.
        """
        try:
            return cls.of(read_document(path))
        except UnreadableIcsError:
            raise
        except (IcsError, ReadingError) as error:
            raise IcsError(UserMessage("{path}: {error}", path=path, error=error)) from None

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Self:
        """Build an ICS from a TOML document.

        Raises:
            IcsError: A key is unknown, a value is invalid, or a hook cannot be started.
            ReadingError: A claimed reading does not exist.
        """
        _require_known_keys("", document, _TABLES)
        subject = _table(document, "subject")
        _require_known_keys("subject.", subject, _SUBJECT)
        for key, value in subject.items():
            _require_type(f"subject.{key}", value, _SUBJECT[key])
        unsupported = frozenset(map(str, subject.get("lacks", ())))
        if unknown := unsupported - BY_NAME.keys():
            raise IcsError(
                UserMessage(
                    "subject.lacks names {command!r}, which is not a command", command=min(unknown)
                )
            )
        if subject.get("network_applies", "at-once") not in _NETWORK_APPLIES:
            raise IcsError(
                UserMessage(
                    "subject.network_applies must be one of {options}",
                    options=", ".join(_NETWORK_APPLIES),
                )
            )
        _require_positive("subject.time_scale", subject.get("time_scale", 1.0), _MAX_TIME_SCALE)
        readings = {k: str(v) for k, v in _table(document, "readings").items()}
        return cls(
            **{key: value for key, value in subject.items() if key != "lacks"},
            unsupported=unsupported,
            dialect=Dialect(readings),
            claimed=frozenset(readings),
            motion=_motion(_table(document, "motion")),
            hooks=_hooks(_table(document, "hooks")),
            sample=_texts(document, "sample", SAMPLE),
            laboratory=_texts(document, "laboratory", LABORATORY),
        )


SAMPLE: Final = ("serial_number", "firmware", "hardware")
"""The keys of the table ``[sample]``, which a certification needs."""
LABORATORY: Final = ("name", "operator")
"""The keys of the table ``[laboratory]``, which a certification needs."""
_TABLES: Final = ("subject", "readings", "motion", "hooks", "sample", "laboratory")
_SUBJECT: Final[Mapping[str, type | tuple[type, ...]]] = {
    "name": str,
    "version": str,
    "url": str,
    "lacks": list,
    "network_applies": str,
    "time_scale": (int, float),
}
_READING: Final = "readings."
_ON_NETWORK: Final = frozenset({"4.4/4"})
_ON_TIME: Final = frozenset({"4.5/4", "4.6/4", "4.9/5"})
_NETWORK_APPLIES: Final = ("at-once", "after-restart")
_MAX_TIME_SCALE: Final = 1e4
_HOOK_TIMEOUT_S: Final = 30.0
_MAX_S: Final = 1e6
_AXES: Final = 3
_MAXIMA: Final = {"step_mm": 1000.0, "speed_percent": 100.0, "jog_s": 60.0, "longest_s": _MAX_S}


def _table(document: Mapping[str, Any], name: str) -> dict[str, Any]:
    table = document.get(name, {})
    if not isinstance(table, dict):
        raise IcsError(UserMessage("[{name}] must be a table", name=name))
    return table


def _texts(document: Mapping[str, Any], name: str, keys: tuple[str, ...]) -> dict[str, str]:
    table = _table(document, name)
    _require_known_keys(f"{name}.", table, keys)
    for key, value in table.items():
        _require_type(f"{name}.{key}", value, str)
    return table


def _require_known_keys(prefix: str, table: Mapping[str, Any], keys: Any) -> None:
    for key in table:
        if key not in keys:
            raise IcsError(
                UserMessage(
                    "{prefix}{key} is not known: choose from {keys}",
                    prefix=prefix,
                    key=key,
                    keys=", ".join(keys),
                )
            )


def _require_type(name: str, value: Any, types: type | tuple[type, ...]) -> None:
    if not isinstance(value, types) or isinstance(value, bool):
        each = types if isinstance(types, tuple) else (types,)
        raise IcsError(
            UserMessage(
                "{name} must be {type}", name=name, type=" or ".join(k.__name__ for k in each)
            )
        )


def _require_positive(name: str, value: Any, maximum: float) -> None:
    _require_type(name, value, (int, float))
    if not 0 < value <= maximum:  # this rejects NaN, too
        raise IcsError(
            UserMessage(
                "{name} must be above 0 and at most {maximum:g}", name=name, maximum=maximum
            )
        )


def _motion(table: Mapping[str, Any]) -> Motion:
    _require_known_keys("motion.", table, [f.name for f in fields(Motion)])
    for key, maximum in _MAXIMA.items():
        if key in table:
            _require_positive(f"motion.{key}", table[key], maximum)
    if "speed_percent" in table:
        _require_type("motion.speed_percent", table["speed_percent"], int)
    box = table.get("box_mm", [])
    _require_type("motion.box_mm", box, list)
    if box and not (len(box) == _AXES and all(map(_is_range, box))):
        raise IcsError("motion.box_mm must be three pairs: the minimum and maximum of x, y and z")
    return Motion(**{**table, "box_mm": tuple((float(a), float(b)) for a, b in box)})


def _is_range(pair: object) -> bool:
    match pair:
        case [float() | int() as low, float() | int() as high]:
            return low <= high  # this rejects NaN, too
    return False


def _hooks(table: Mapping[str, Any]) -> dict[str, CommandHook]:
    timeout_s = table.get("timeout_s", _HOOK_TIMEOUT_S)
    _require_positive("hooks.timeout_s", timeout_s, _MAX_S)
    commands = {name: command for name, command in table.items() if name != "timeout_s"}
    _require_known_keys("hooks.", commands, HOOKS)
    for name, command in commands.items():
        _require_type(f"hooks.{name}", command, str)
    hooks = {
        name: CommandHook(name, command, float(timeout_s)) for name, command in commands.items()
    }
    for hook in hooks.values():
        try:
            hook.check()
        except HookError as error:
            raise IcsError(*error.args) from None
    return hooks
