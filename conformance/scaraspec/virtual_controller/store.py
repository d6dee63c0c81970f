"""The store: program files and settings, in memory or also in a directory.

Names and contents are opaque bytes; the behaviour decides when a file may be written and what a
setting means. A change is written to disk before it becomes visible. Writes are atomic: after a
kill the disk has the old or the new file, never a partial one.
"""

import contextlib
import errno
import json
import math
import os
import reprlib
import string
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote_to_bytes

from scaraspec.user_message import UserMessage
from scaraspec.virtual_controller.arm import HOME

NAME_MAX_BYTES = 255
MAX_BYTES = 4 * 1024 * 1024
"""Maximum total size of all programs: about 65 000 nodes, which parse in one to two seconds."""
MAX_FILES = 1000


class StoreError(Exception):
    """The store cannot execute the request. The text is the reason."""


class NameRefusedError(StoreError):
    """The name is empty, or could leave the directory or break a list."""


class MissingError(StoreError):
    """There is no program with this name."""


class StoreFullError(StoreError):
    """There is not enough space."""


@dataclass(frozen=True, slots=True)
class Settings:
    """The settings of 0x03, 0x05, 0x0E, 0x35 and 0x36; they survive power-off (A-4-6).

    Attributes:
        password: Password of the login (4.1).
        ip: IPv4 address in dotted decimal (4.4).
        mask: Subnet mask.
        gateway: IPv4 address of the gateway.
        default_program: Name of the default program (4.13); empty if there is none.
        gripper_center: x, y, z in mm relative to the tool (4.20).
        initial_tool_position: x, y, z in mm and thetaX, thetaY, thetaZ in degrees (4.21).
    """

    password: bytes = b"password"
    ip: str = "192.168.1.2"
    mask: str = "255.255.255.0"
    gateway: str = "192.168.1.1"
    default_program: bytes = b""
    gripper_center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    initial_tool_position: tuple[float, float, float, float, float, float] = (*HOME, 0.0, 0.0)


class Store:
    """Programs and settings in memory, with limits.

    Args:
        max_bytes: Maximum total size of all programs.
        max_files: Maximum number of programs.
    """

    def __init__(self, max_bytes: int = MAX_BYTES, max_files: int = MAX_FILES) -> None:
        self._max_bytes = max_bytes
        self._max_files = max_files
        self._programs: dict[bytes, bytes] = {}
        self._settings = Settings()

    def names(self) -> list[bytes]:
        """The names of all programs, sorted by bytes (A-4.10-5)."""
        return sorted(self._programs)

    def __contains__(self, name: bytes) -> bool:
        """Whether there is a program with this name."""
        return name in self._programs

    def read(self, name: bytes) -> bytes:
        """Return the content of a program.

        Raises:
            MissingError: There is no program with this name.
        """
        if name not in self._programs:
            raise MissingError(UserMessage("there is no program {name}", name=_show(name)))
        return self._programs[name]

    def check(self, name: bytes, size_bytes: int) -> None:
        """Check that a program of this size can be written with this name.

        Raises:
            NameRefusedError: The name is empty, longer than 255 bytes, ``.`` or ``..``, or
                contains a slash, a backslash, a bar or a NUL (A-5-20).
            StoreFullError: There is not enough space.
        """
        if not 1 <= len(name) <= NAME_MAX_BYTES:
            raise NameRefusedError(
                UserMessage(
                    "a name has 1 to {max_bytes} bytes, not {byte_count}",
                    max_bytes=NAME_MAX_BYTES,
                    byte_count=len(name),
                )
            )
        if name in (b".", b"..") or not set(name).isdisjoint(b"/\\|\0"):
            raise NameRefusedError(
                UserMessage(
                    "{name} is not a valid name: it contains a separator, or only dots",
                    name=_show(name),
                )
            )
        others = {other: data for other, data in self._programs.items() if other != name}
        if len(others) >= self._max_files:
            raise StoreFullError(
                UserMessage(
                    "the store is full: it holds {max_files} programs",
                    max_files=self._max_files,
                )
            )
        free_bytes = self._max_bytes - sum(map(len, others.values()))
        if size_bytes > free_bytes:
            raise StoreFullError(
                UserMessage(
                    "the store is full: {size_bytes} bytes needed, {free_bytes} bytes free",
                    size_bytes=size_bytes,
                    free_bytes=free_bytes,
                )
            )

    def write(self, name: bytes, data: bytes) -> None:
        """Store a program; it replaces a program with the same name.

        Raises:
            StoreError: See `check`; or the disk failed, then nothing has changed.
        """
        self.check(name, len(data))
        self._programs[name] = data

    def delete(self, name: bytes) -> None:
        """Delete a program.

        Raises:
            StoreError: There is no such program (`MissingError`), or the disk failed.
        """
        self.read(name)
        del self._programs[name]

    @property
    def settings(self) -> Settings:
        """The current settings."""
        return self._settings

    def save(self, settings: Settings) -> None:
        """Replace the settings.

        Raises:
            StoreError: The disk failed; nothing has changed.
        """
        self._settings = settings


class DirectoryStore(Store):
    """A store with a copy in a directory, which it reads once, at the start.

    The directory contains ``settings.json`` and the programs in ``programs``. Only one process at
    a time may use it. The store does not touch files that it did not create.

    Raises:
        StoreError: The directory cannot be used or exceeds the limits, or its settings are
            damaged. Then only leftover temporary files were removed.
    """

    def __init__(
        self, directory: Path, max_bytes: int = MAX_BYTES, max_files: int = MAX_FILES
    ) -> None:
        super().__init__(max_bytes, max_files)
        self._directory = directory
        self._settings_path = directory / "settings.json"
        self._programs_path = directory / "programs"
        with _disk_errors(
            UserMessage("{directory} cannot be used as a store", directory=directory)
        ):
            self._programs_path.mkdir(parents=True, exist_ok=True)
            for leftover in directory.glob(f"{_TEMPORARY_PREFIX}*"):
                leftover.unlink()
            if self._settings_path.exists():
                super().save(_load_settings(self._settings_path))
            for path in sorted(self._programs_path.rglob("*")):
                name = _name_of(path.relative_to(self._programs_path))
                if name is not None and path.is_file():
                    self.check(name, path.stat().st_size)
                    super().write(name, path.read_bytes())

    def write(self, name: bytes, data: bytes) -> None:
        """Store a program on disk, then in memory."""
        self.check(name, len(data))
        self._put(self._programs_path / _path_of(name), data)
        super().write(name, data)

    def delete(self, name: bytes) -> None:
        """Delete a program on disk, then in memory."""
        self.read(name)
        path = self._programs_path / _path_of(name)
        with _disk_errors(UserMessage("{name} cannot be deleted", name=_show(name))):
            path.unlink()
            _sync(path.parent)
        super().delete(name)

    def save(self, settings: Settings) -> None:
        """Replace the settings on disk, then in memory."""
        self._put(self._settings_path, _dump_settings(settings))
        super().save(settings)

    def _put(self, path: Path, data: bytes) -> None:
        """Write a file atomically: write a temporary file, sync and rename it."""
        with _disk_errors(UserMessage("{path} cannot be written", path=path)):
            path.parent.mkdir(parents=True, exist_ok=True)
            handle, temporary = tempfile.mkstemp(prefix=_TEMPORARY_PREFIX, dir=self._directory)
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(data)
                    file.flush()
                    os.fsync(file.fileno())
                Path(temporary).replace(path)
            except OSError:
                Path(temporary).unlink(missing_ok=True)
                raise
            _sync(path.parent)


def import_programs(store: Store, folder: Path) -> None:
    """Copy the files of a folder into a store, except hidden files and names that exist.

    Raises:
        StoreError: The folder cannot be read, or a file does not fit or has no valid name.
    """
    with _disk_errors(UserMessage("the programs in {folder} cannot be read", folder=folder)):
        for path in sorted(folder.iterdir()):
            name = os.fsencode(path.name)
            if path.is_file() and not path.name.startswith(".") and name not in store:
                store.check(name, path.stat().st_size)
                store.write(name, path.read_bytes())


# ---------------------------------------------------------------------- names on disk

_TEMPORARY_PREFIX = ".new-"

# No upper case, so that names stay distinct on case-insensitive file systems.
_PLAIN = frozenset((string.ascii_lowercase + string.digits + "._-").encode())

# A path component has at most 255 characters: "=", three characters per byte, and one more.
_COMPONENT_BYTES = 64


def _path_of(name: bytes) -> Path:
    """Return the path of a program: percent-encoded, and nested directories if long.

    A file is ``=...=`` and a directory ``=...+``: the marks keep them apart and hide leading dots,
    trailing dots and the device names of Windows.
    """
    pieces = (name[i : i + _COMPONENT_BYTES] for i in range(0, len(name), _COMPONENT_BYTES))
    *directories, file = (
        "=" + "".join(chr(b) if b in _PLAIN else f"%{b:02x}" for b in piece) for piece in pieces
    )
    return Path(*(directory + "+" for directory in directories), file + "=")


def _name_of(path: Path) -> bytes | None:
    """Return the program name of a path; None for a file that the store did not create."""
    if not str(path).isascii():
        return None
    name = b"".join(unquote_to_bytes(part[1:-1]) for part in path.parts)
    return name if name and _path_of(name) == path else None


def _show(name: bytes) -> str:
    return repr(name.decode("utf-8", "backslashreplace"))


# ---------------------------------------------------------------------- settings on disk

_VERSION = 1


def _dump_settings(settings: Settings) -> bytes:
    """Convert settings to JSON; bytes that are not UTF-8 become surrogate escapes."""
    values = {
        key: value.decode("utf-8", "surrogateescape") if isinstance(value, bytes) else value
        for key, value in asdict(settings).items()
    }
    return json.dumps({"version": _VERSION, **values}, indent=2, allow_nan=False).encode()


def _load_settings(path: Path) -> Settings:
    try:
        return _parse_settings(path.read_bytes())
    except (ValueError, OverflowError, RecursionError) as error:
        raise StoreError(
            UserMessage(
                "{path} is not a valid settings file ({error}): repair it, or move it away to "
                "start with the defaults",
                path=path,
                error=error,
            )
        ) from error


def _parse_settings(data: bytes) -> Settings:
    values = json.loads(data)
    if not isinstance(values, dict) or values.pop("version", None) != _VERSION:
        raise ValueError(UserMessage("the version is not {version}", version=_VERSION))
    defaults = asdict(Settings())
    if values.keys() != defaults.keys():
        raise ValueError(UserMessage("the keys are not version, {keys}", keys=", ".join(defaults)))
    return Settings(**{key: _parse(key, values[key], defaults[key]) for key in defaults})


def _parse(key: str, value: Any, default: object) -> Any:
    """Convert a JSON value to the type of the default."""
    match value, default:
        case str(), str():
            return value
        case str(), bytes():
            return value.encode("utf-8", "surrogateescape")
        case list(), tuple() if len(value) == len(default):
            numbers = tuple(float(v) for v in value if isinstance(v, int | float))
            if len(numbers) == len(default) and all(map(math.isfinite, numbers)):
                return numbers
    raise ValueError(
        UserMessage("{value} is not a valid {key}", value=reprlib.repr(value), key=key)
    )


# ---------------------------------------------------------------------- the disk


@contextlib.contextmanager
def _disk_errors(problem: str) -> Iterator[None]:
    """Raise a disk error as `StoreError`; `problem` is the start of its sentence."""
    try:
        yield
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        raise (StoreFullError if full else StoreError)(
            UserMessage("{problem}: {reason}", problem=problem, reason=error.strerror)
        ) from error


def _sync(directory: Path) -> None:
    """Sync a directory, if the system supports it."""
    with contextlib.suppress(OSError):
        handle = os.open(directory, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
