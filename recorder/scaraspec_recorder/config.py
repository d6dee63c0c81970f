"""Configuration of recorders: controllers, listening addresses, output folders and retention.

Belongs here: checks of options and TOML files. Does not belong here: opening files or sockets. The
keys of a TOML table are the options of ``scaraspec record``.
"""

import difflib
import os
import re
import reprlib
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from types import UnionType
from typing import Any, Final

from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.user_message import UserMessage
from scaraspec_recorder.fault_injection.injection_file import load_injection
from scaraspec_recorder.fault_injection.rules import Injection
from scaraspec_recorder.recordings.rotation import RotationPolicy, parse_rotation
from scaraspec_recorder.recordings.trigger_command import parse_command
from scaraspec_recorder.recordings.triggers import parse_trigger
from scaraspec_recorder.recordings.upload_store import parse_store_url
from scaraspec_recorder.recordings.uploader import RATE_BYTES, Upload
from scaraspec_recorder.sinks.file_names import safe_name
from scaraspec_recorder.sinks.own_files import PRIVATE_MODE
from scaraspec_recorder.sinks.sink import SinkFactory
from scaraspec_recorder.tap.routes import Mode
from scaraspec_recorder.toml_file import TomlError, read_toml
from scaraspec_recorder.units import Limits, parse_duration, parse_limits, parse_size

DEFAULT_OUT: Final = Path("captures")
MODES: Final = {"port": Mode.EXPLICIT, "redirect": Mode.REDIRECT, "tproxy": Mode.TPROXY}
DEFAULT_LISTEN: Final = {
    Mode.EXPLICIT: f"127.0.0.1:{DEFAULT_PORT}",
    Mode.REDIRECT: f"0.0.0.0:{DEFAULT_PORT + 1}",  # all addresses of this machine
    Mode.TPROXY: f"127.0.0.1:{DEFAULT_PORT + 1}",
}
"""Default listening address of each mode."""

_HOURLY: Final = parse_rotation("1h")
"""Rotation when only limits are set. A file that never ends could not be removed."""

_MAX_ROBOTS: Final = 256
_FILE_MODE: Final = re.compile("0?6[0246]{2}")


class TimestampSource(StrEnum):
    """Source of the reception timestamps."""

    USER = "user"  # the recorder, at the read call; adds no latency
    KERNEL = "kernel"  # the kernel, if it supports this; reads take longer


class ConfigError(Exception):
    """The configuration is invalid. The message is one sentence for the user."""


@dataclass(frozen=True, slots=True)
class RobotConfig:
    """Configuration of the recording of one robot.

    Attributes:
        name: The robot's name, part of the file names.
        url: URL of the controller.
        listen: Addresses that clients connect to.
        out: Output folder.
        mode: How client connections reach the recorder.
        redact: Whether to mask passwords in the raw bytes, too.
        rotate: When a file ends. None: one file, or one file per hour if limits are set.
        keep: Limits of age and total size; None keeps all recordings.
        min_free_bytes: Disk space that must stay free; 0 for no limit.
        triggers: Conditions that write a mark into the recording.
        on_trigger: Command to run when a trigger fires; empty for none.
        protect_ns: How long before and after a mark recordings are protected from `keep`.
        injection: Faults to inject; None for none.
        i_mean_it: Whether injected faults may affect clients on other machines.
        timestamps: Source of the reception timestamps.
        file_mode: Access rights of the files.
        no_rrd: Whether to write no .rrd files.
        durable: Whether a power failure costs a second at most.
        archive: Path or URL of the store that finished files are uploaded to; empty for none.
        archive_rate_bytes: Maximum rate of uploads, in bytes a second.
        keep_until_archived: Whether `keep` removes only files that are uploaded.
    """

    name: str
    url: str
    listen: tuple[str, ...] = (DEFAULT_LISTEN[Mode.EXPLICIT],)
    out: Path = DEFAULT_OUT
    mode: Mode = Mode.EXPLICIT
    redact: bool = False
    rotate: RotationPolicy | None = None
    keep: Limits | None = None
    min_free_bytes: int = 0
    triggers: tuple[str, ...] = ()
    on_trigger: tuple[str, ...] = ()
    protect_ns: int = 0
    injection: Injection | None = None
    i_mean_it: bool = False
    timestamps: TimestampSource = TimestampSource.USER
    file_mode: int = PRIVATE_MODE
    no_rrd: bool = False
    durable: bool = False
    archive: str = ""
    archive_rate_bytes: int = RATE_BYTES
    keep_until_archived: bool = False

    @property
    def upload(self) -> Upload | None:
        """Where finished files are uploaded to; None for nowhere."""
        if not self.archive:
            return None
        return Upload(self.archive, self.name, self.archive_rate_bytes, self.file_mode)

    def sink(self, session: Mapping[str, str], *, draw: bool, needs_login: bool) -> SinkFactory:
        """Return the factory of the sink that writes the files.

        It writes one file, capture.mcap, unless `rotate`, `keep`, `min_free_bytes` or `archive` is
        set. Then it writes several files, named by time and robot, and the index contents.jsonl.

        Args:
            session: Metadata of the session, such as the addresses.
            draw: Whether .rrd files can be written.
            needs_login: False for a serial link (L83).
        """
        from scaraspec_recorder.recordings.archive import (  # noqa: PLC0415 - the MCAP library
            Archive,
            archive_sink,
        )
        from scaraspec_recorder.recordings.capture import (  # noqa: PLC0415 - the MCAP library
            capture_sink,
        )
        from scaraspec_recorder.recordings.recovery import (  # noqa: PLC0415 - the MCAP library
            sink_after_repair,
        )

        draw = draw and not self.no_rrd
        if not (self.rotate or self.keep or self.min_free_bytes or self.archive):
            make = partial(
                capture_sink,
                session=session,
                needs_login=needs_login,
                draw=draw,
                redact=self.redact,
                triggers=self.triggers,
                on_trigger=self.on_trigger,
                robot=self.name,
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
            on_trigger=self.on_trigger,
            protect_ns=self.protect_ns,
            keep_until_in=self.archive if self.keep_until_archived else "",
        )
        return partial(archive_sink, archive=archive)


def read_robot(name: str, table: Mapping[str, Any], prefix: str) -> RobotConfig:
    """Check the configuration of one robot.

    Args:
        name: The robot's name.
        table: Values by option name, such as ``min-free``.
        prefix: Text before the option name in error messages.

    Raises:
        ConfigError: A key is unknown, a value is invalid, or two values exclude each other.
    """
    values = {}
    for key, value in table.items():
        if key not in _KEYS:
            raise ConfigError(
                UserMessage(
                    "{prefix}{key} is not a setting{suggestion}",
                    prefix=prefix,
                    key=key,
                    suggestion=_suggestion(key, _KEYS),
                )
            )
        kind, field, read = _KEYS[key]
        if not isinstance(value, kind):
            raise ConfigError(
                UserMessage(
                    "{prefix}{key}: {value} is not {kinds}",
                    prefix=prefix,
                    key=key,
                    value=reprlib.repr(value),
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
                "{prefix}url is missing: set the controller's URL, such as tcp://192.168.1.2",
                prefix=prefix,
            )
        )
    values.setdefault("listen", (DEFAULT_LISTEN[values.get("mode", Mode.EXPLICIT)],))
    robot = RobotConfig(name, **values)
    _check_names(robot, prefix)
    _check_effects(robot, prefix)
    return robot


def _check_names(robot: RobotConfig, prefix: str) -> None:
    """Check that the system can encode the names of the files.

    Raises:
        ConfigError: It cannot.
    """
    for text in (robot.name, str(robot.out)):
        try:
            os.fsencode(text)
        except UnicodeEncodeError:
            raise ConfigError(
                UserMessage(
                    "{prefix}out: {text} cannot be used in file names, whose encoding is {encoding}"
                    " here: use other letters, or a UTF-8 locale",
                    prefix=prefix,
                    text=text,
                    encoding=sys.getfilesystemencoding(),
                )
            ) from None


def _check_effects(robot: RobotConfig, prefix: str) -> None:
    """Check that each setting has an effect.

    Raises:
        ConfigError: A setting needs another one.
    """
    if robot.durable and sys.platform == "win32":
        raise ConfigError(UserMessage("{prefix}durable needs a POSIX system", prefix=prefix))
    if robot.i_mean_it and not robot.injection:
        raise ConfigError(
            UserMessage("{prefix}i-mean-it has no effect without inject: remove it", prefix=prefix)
        )
    for key, used in (("on-trigger", robot.on_trigger), ("protect", robot.protect_ns)):
        if used and not robot.triggers:
            raise ConfigError(
                UserMessage("{prefix}{key} has no effect without trigger", prefix=prefix, key=key)
            )
    for key, used in (
        ("archive-rate", robot.archive_rate_bytes != RATE_BYTES),
        ("keep-until-archived", robot.keep_until_archived),
    ):
        if used and not robot.archive:
            raise ConfigError(
                UserMessage("{prefix}{key} has no effect without archive", prefix=prefix, key=key)
            )
    for key, used in (
        ("protect", robot.protect_ns),
        ("keep-until-archived", robot.keep_until_archived),
    ):
        if used and not (robot.keep or robot.min_free_bytes):
            raise ConfigError(
                UserMessage(
                    "{prefix}{key} has no effect without keep or min-free", prefix=prefix, key=key
                )
            )


def read_config(path: Path) -> tuple[RobotConfig, ...]:
    """Read a TOML file: settings for all robots first, then one table per robot.

    The files of a robot are in the folder `out`/name, unless its own table sets `out`.

    Raises:
        ConfigError: The file cannot be read, or its content is invalid.
    """
    shared = _load(path)
    tables = shared.pop("robots", None)
    if not isinstance(tables, dict) or not 0 < len(tables) <= _MAX_ROBOTS:
        raise ConfigError(
            UserMessage(
                "{path} must configure 1 to 256 robots: add tables such as [robots.line-3]",
                path=path,
            )
        )
    for key in shared:
        if key not in _SHARED_KEYS:
            raise ConfigError(
                UserMessage(
                    "{path}: {key} is not a setting for all robots{suggestion}",
                    path=path,
                    key=key,
                    suggestion=_suggestion(key, _SHARED_KEYS),
                )
            )
    robots = tuple(_from_file(path, name, table, shared) for name, table in tables.items())
    for key in ("listen", "out"):
        taken: dict[object, str] = {}
        for robot in robots:
            used = getattr(robot, key)
            for value in used if isinstance(used, tuple) else (used,):
                other = taken.setdefault(value, robot.name)
                if other != robot.name:
                    raise ConfigError(
                        UserMessage(
                            "{path}: {robot} and {other} have the same {key}, {value}: change one",
                            path=path,
                            robot=robot.name,
                            other=other,
                            key=key,
                            value=value,
                        )
                    )
    return robots


def _from_file(path: Path, name: str, table: object, shared: Mapping[str, Any]) -> RobotConfig:
    if not isinstance(table, dict):
        raise ConfigError(
            UserMessage(
                "{path}: robots.{name} is not a table: write [robots.{name}]", path=path, name=name
            )
        )
    if name != safe_name(name):
        raise ConfigError(
            UserMessage(
                "{path}: {name!r} cannot be used in file names: use letters, digits and hyphens",
                path=path,
                name=name,
            )
        )
    out = shared.get("out", str(DEFAULT_OUT))
    own_out = {"out": str(Path(out) / name)} if isinstance(out, str) else {}
    return read_robot(name, {**shared, **own_out, **table}, f"{path}: robots.{name}.")


def _load(path: Path) -> dict[str, Any]:
    try:
        return read_toml(path)
    except TomlError as error:
        raise ConfigError(UserMessage("{path} {error}", path=path, error=error)) from None


def _mode(text: str) -> Mode:
    if text not in MODES:
        raise ValueError(f"{text!r} is not a mode: use one of {', '.join(MODES)}")
    return MODES[text]


def _timestamp_source(text: str) -> TimestampSource:
    if text not in tuple(TimestampSource):
        raise ValueError(
            f"{text!r} is not a timestamp source: use one of {', '.join(TimestampSource)}"
        )
    return TimestampSource(text)


def _file_mode(text: str) -> int:
    if not _FILE_MODE.fullmatch(text):
        raise ValueError(f"{text!r} is not a mode of files that you can read and write, as 640")
    return int(text, 8)


def _listen(value: str | list[object]) -> tuple[str, ...]:
    texts = [value] if isinstance(value, str) else _strings(value)
    if not texts:
        raise ValueError("there must be an address")
    return tuple(dict.fromkeys(texts))


def _strings(values: Iterable[object]) -> list[str]:
    texts = []
    for value in values:
        if not isinstance(value, str):
            raise ValueError(f"{value!r} is not a string")  # noqa: TRY004 - invalid in the file, not in code
        texts.append(value)
    return texts


def _injection(text: str) -> Injection:
    return load_injection(Path(text))


def _triggers(texts: Iterable[object]) -> tuple[str, ...]:
    conditions = _strings(texts)
    for text in conditions:
        parse_trigger(text)
    return tuple(dict.fromkeys(conditions))


def _suggestion(key: str, known_keys: Iterable[str]) -> str:
    near = difflib.get_close_matches(key, known_keys, n=1)
    return f": did you mean {near[0]}?" if near else f": use one of {', '.join(known_keys)}"


_Read = Callable[[Any], Any]
_ONE_OR_MORE: Final = str | list
_KEYS: Final[dict[str, tuple[type | UnionType, str, _Read]]] = {
    "url": (str, "url", str),
    "listen": (_ONE_OR_MORE, "listen", _listen),
    "out": (str, "out", Path),
    "mode": (str, "mode", _mode),
    "redact": (bool, "redact", bool),
    "rotate": (str, "rotate", parse_rotation),
    "keep": (str, "keep", parse_limits),
    "min-free": (str, "min_free_bytes", parse_size),
    "trigger": (list, "triggers", _triggers),
    "on-trigger": (str, "on_trigger", parse_command),
    "protect": (str, "protect_ns", parse_duration),
    "inject": (str, "injection", _injection),
    "i-mean-it": (bool, "i_mean_it", bool),
    "timestamps": (str, "timestamps", _timestamp_source),
    "file-mode": (str, "file_mode", _file_mode),
    "no-rrd": (bool, "no_rrd", bool),
    "durable": (bool, "durable", bool),
    "archive": (str, "archive", parse_store_url),
    "archive-rate": (str, "archive_rate_bytes", parse_size),
    "keep-until-archived": (bool, "keep_until_archived", bool),
}
"""For each option: its type in the file, the attribute of `RobotConfig` and its parser."""

_PER_ROBOT_ONLY: Final = ("url", "listen", "inject", "i-mean-it")
_SHARED_KEYS: Final = tuple(key for key in _KEYS if key not in _PER_ROBOT_ONLY)
_KINDS: Final[dict[type | UnionType, str]] = {
    str: "a string",
    bool: "true or false",
    list: "a list of strings",
    _ONE_OR_MORE: "a string or a list of strings",
}
