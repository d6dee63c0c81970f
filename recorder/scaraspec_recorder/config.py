"""The configuration of recorders: what is recorded, where it comes in, what is kept.

Law: texts in, checked values out, and one clear sentence for anything wrong; nothing is opened. The
keys of a table are the options of ``scaraspec record``, so that both mean the same.
"""

import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any, Final

from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.user_message import UserMessage
from scaraspec_recorder.fault_injection.injection_file import load_injection
from scaraspec_recorder.fault_injection.rules import Injection
from scaraspec_recorder.recordings.archive import Archive, archive_sink
from scaraspec_recorder.recordings.capture import capture_sink
from scaraspec_recorder.recordings.recovery import sink_after_repair
from scaraspec_recorder.recordings.rotation import RotationPolicy, parse_rotation
from scaraspec_recorder.recordings.triggers import parse_trigger
from scaraspec_recorder.sinks.file_names import safe_name
from scaraspec_recorder.sinks.sink import SinkFactory
from scaraspec_recorder.tap.routes import Mode
from scaraspec_recorder.toml_file import TomlError, read_toml
from scaraspec_recorder.units import Limits, parse_limits, parse_size

DEFAULT_OUT: Final = Path("captures")
MODES: Final = {"port": Mode.EXPLICIT, "redirect": Mode.REDIRECT, "tproxy": Mode.TPROXY}
DEFAULT_LISTEN: Final = {
    Mode.EXPLICIT: f"127.0.0.1:{DEFAULT_PORT}",
    Mode.REDIRECT: f"0.0.0.0:{DEFAULT_PORT + 1}",  # whichever address its clients come in at
    Mode.TPROXY: f"127.0.0.1:{DEFAULT_PORT + 1}",
}
"""Where the recorder listens if nothing is said, by mode."""

_HOURLY: Final = parse_rotation("1h")
"""How long a file lasts if only limits are set: a file that never ends could not be removed."""

_MOST_ROBOTS: Final = 256


class TimestampSource(StrEnum):
    """Who says when bytes came in."""

    USER = "user"  # the recorder, when it reads them: costs the link nothing
    KERNEL = "kernel"  # the system, where it can: reading them so takes longer


class ConfigError(Exception):
    """A configuration that cannot be; the message is one sentence for the user."""


@dataclass(frozen=True, slots=True)
class RobotConfig:
    """What is recorded of one robot.

    Attributes:
        name: What its files are called by.
        url: The controller's link.
        listen: Where clients connect.
        out: The folder of the recording.
        mode: How clients come to it.
        redact: Whether to hide passwords in the raw layer too.
        rotate: When a file ends; None for one file, or for each hour if limits are set.
        keep: What is kept; None for all.
        min_free_bytes: How much of the disk is to stay free.
        triggers: The conditions at which the recording is marked.
        injection: Faults on purpose; None for none.
        i_mean_it: Whether they may reach clients on other machines.
        timestamps: Who says when bytes came in.
    """

    name: str
    url: str
    listen: str = DEFAULT_LISTEN[Mode.EXPLICIT]
    out: Path = DEFAULT_OUT
    mode: Mode = Mode.EXPLICIT
    redact: bool = False
    rotate: RotationPolicy | None = None
    keep: Limits | None = None
    min_free_bytes: int = 0
    triggers: tuple[str, ...] = ()
    injection: Injection | None = None
    i_mean_it: bool = False
    timestamps: TimestampSource = TimestampSource.USER

    def sink(self, session: Mapping[str, str], *, draw: bool, needs_login: bool) -> SinkFactory:
        """Return what makes the sink that writes the files.

        It writes one file, capture.mcap, unless `rotate`, `keep` or `min_free_bytes` is set. Then
        it writes several files, named by time and robot, and a table of contents.

        Args:
            session: What is known beforehand, such as the addresses.
            draw: Whether to write .rrd files too.
            needs_login: False for a serial link (L83).
        """
        if not (self.rotate or self.keep or self.min_free_bytes):
            make = partial(
                capture_sink,
                session=session,
                needs_login=needs_login,
                draw=draw,
                redact=self.redact,
                triggers=self.triggers,
            )
            return partial(sink_after_repair, make=make)
        archive = Archive(
            robot=self.name,
            session=session,
            needs_login=needs_login,
            draw=draw,
            redact=self.redact,
            rotate=self.rotate or _HOURLY,
            keep=self.keep or Limits(),
            min_free_bytes=self.min_free_bytes,
            triggers=self.triggers,
        )
        return partial(archive_sink, archive=archive)


def read_robot(name: str, table: Mapping[str, Any], prefix: str) -> RobotConfig:
    """Check what is said of one robot.

    Args:
        name: The robot.
        table: Values by the names of options, such as ``min-free``.
        prefix: Stands before such a name where a sentence says what is wrong.

    Raises:
        ConfigError: A key or a value is wrong, or two do not go together.
    """
    values = {}
    for key, value in table.items():
        if key not in _KEYS:
            raise ConfigError(
                UserMessage(
                    "{prefix}{key} is no setting{meant}",
                    prefix=prefix,
                    key=key,
                    meant=_meant(key, _KEYS),
                )
            )
        kind, field, read = _KEYS[key]
        if not isinstance(value, kind):
            raise ConfigError(
                UserMessage(
                    "{prefix}{key}: {value!r} is no {kinds}",
                    prefix=prefix,
                    key=key,
                    value=value,
                    kinds=_KINDS[kind],
                )
            )
        try:
            values[field] = read(value)
        except ValueError as error:
            raise ConfigError(
                UserMessage("{prefix}{key}: {error}", prefix=prefix, key=key, error=error)
            ) from None
    if not values.get("url"):
        raise ConfigError(
            UserMessage(
                "{prefix}url is missing: name the controller, as tcp://192.168.1.2", prefix=prefix
            )
        )
    values.setdefault("listen", DEFAULT_LISTEN[values.get("mode", Mode.EXPLICIT)])
    robot = RobotConfig(name, **values)
    if robot.i_mean_it and not robot.injection:
        raise ConfigError(
            UserMessage(
                "{prefix}i-mean-it means nothing without inject: leave it out", prefix=prefix
            )
        )
    return robot


def read_config(path: Path) -> tuple[RobotConfig, ...]:
    """Read a TOML file: a table for each robot, and before them what holds for all.

    Each robot's files have a folder of its name in `out`, unless its own table names another.

    Raises:
        ConfigError: It cannot be read, or what it says cannot be.
    """
    for_all = _load(path)
    tables = for_all.pop("robots", None)
    if not isinstance(tables, dict) or not 0 < len(tables) <= _MOST_ROBOTS:
        raise ConfigError(
            UserMessage("{path} must name robots: write tables such as [robots.line-3]", path=path)
        )
    for key in for_all:
        if key not in _FOR_ALL:
            raise ConfigError(
                UserMessage(
                    "{path}: {key} is no setting for all robots{meant}",
                    path=path,
                    key=key,
                    meant=_meant(key, _FOR_ALL),
                )
            )
    robots = tuple(_from_file(path, name, table, for_all) for name, table in tables.items())
    for key in ("listen", "out"):
        taken: dict[object, str] = {}
        for robot in robots:
            value = getattr(robot, key)
            other = taken.setdefault(value, robot.name)
            if other != robot.name:
                raise ConfigError(
                    UserMessage(
                        "{path}: {robot} and {other} have the same {key}, {value}: name another",
                        path=path,
                        robot=robot.name,
                        other=other,
                        key=key,
                        value=value,
                    )
                )
    return robots


def _from_file(path: Path, name: str, table: object, for_all: Mapping[str, Any]) -> RobotConfig:
    if not isinstance(table, dict):
        raise ConfigError(
            UserMessage(
                "{path}: robots.{name} is no table: write [robots.{name}]", path=path, name=name
            )
        )
    if name != safe_name(name):
        raise ConfigError(
            UserMessage(
                "{path}: {name!r} cannot name files: take letters, digits and hyphens",
                path=path,
                name=name,
            )
        )
    out = for_all.get("out", str(DEFAULT_OUT))
    own_out = {"out": str(Path(out) / name)} if isinstance(out, str) else {}
    return read_robot(name, {**for_all, **own_out, **table}, f"{path}: robots.{name}.")


def _load(path: Path) -> dict[str, Any]:
    try:
        return read_toml(path)
    except TomlError as error:
        raise ConfigError(UserMessage("{path} {error}", path=path, error=error)) from None


def _mode(text: str) -> Mode:
    if text not in MODES:
        raise ValueError(f"{text!r} is no mode: take {', '.join(MODES)}")
    return MODES[text]


def _clock(text: str) -> TimestampSource:
    if text not in tuple(TimestampSource):
        raise ValueError(f"{text!r} is no clock: take {', '.join(TimestampSource)}")
    return TimestampSource(text)


def _injection(text: str) -> Injection:
    return load_injection(Path(text))


def _triggers(texts: Iterable[object]) -> tuple[str, ...]:
    for text in texts:
        if not isinstance(text, str):
            raise ValueError(f"{text!r} is no text")  # noqa: TRY004 - wrong in a file, not in code
        parse_trigger(text)
    return tuple(dict.fromkeys(str(text) for text in texts))


def _meant(key: str, among: Iterable[str]) -> str:
    near = difflib.get_close_matches(key, among, n=1)
    return f": did you mean {near[0]}?" if near else f": there are {', '.join(among)}"


_Read = Callable[[Any], Any]
_KEYS: Final[dict[str, tuple[type, str, _Read]]] = {
    "url": (str, "url", str),
    "listen": (str, "listen", str),
    "out": (str, "out", Path),
    "mode": (str, "mode", _mode),
    "redact": (bool, "redact", bool),
    "rotate": (str, "rotate", parse_rotation),
    "keep": (str, "keep", parse_limits),
    "min-free": (str, "min_free_bytes", parse_size),
    "trigger": (list, "triggers", _triggers),
    "inject": (str, "injection", _injection),
    "i-mean-it": (bool, "i_mean_it", bool),
    "timestamps": (str, "timestamps", _clock),
}
"""Of every option: its type in a file, the attribute of `RobotConfig`, and what reads it."""

_OF_ONE: Final = ("url", "listen", "inject", "i-mean-it")
_FOR_ALL: Final = tuple(key for key in _KEYS if key not in _OF_ONE)
_KINDS: Final = {str: "text", bool: "true or false", list: "list of texts"}
