"""The store: program files and settings, in memory or mirrored in a directory.

What is kept and how it survives lives here. When a file may be written, and what a setting means,
is decided elsewhere: names and contents are opaque bytes. A change is on disk before it is seen,
and it is there whole or not at all: a killed process leaves the old or the new, never a torn file.
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
"""Bytes that all programs together may have: some 65 000 nodes, which parse in a second or two."""
MAX_FILES = 1000


class StoreError(Exception):
    """The store cannot do what was asked; the text says why."""


class NameRefusedError(StoreError):
    """The name could leave the store or break a list, or is none."""


class MissingError(StoreError):
    """No program has this name."""


class StoreFullError(StoreError):
    """There is no room."""


@dataclass(frozen=True, slots=True)
class Settings:
    """What 0x03, 0x05, 0x0E, 0x35 and 0x36 set; it survives power-off (A-4-6).

    Attributes:
        password: For the login (4.1).
        ip: IPv4 address in dotted decimal (4.4).
        mask: Subnet mask.
        gateway: Gateway.
        default_program: Its name (4.13); empty if there is none.
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
    """Programs and settings in memory, within bounds.

    Args:
        max_bytes: Bytes that all programs together may have.
        max_files: How many programs there may be.
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
        """Whether there is a program of this name."""
        return name in self._programs

    def read(self, name: bytes) -> bytes:
        """The content of a program.

        Raises:
            MissingError: There is none.
        """
        if name not in self._programs:
            raise MissingError(UserMessage("there is no program {name}", name=_show(name)))
        return self._programs[name]

    def check(self, name: bytes, size_bytes: int) -> None:
        """Make sure that a program of this size can be written under this name.

        Raises:
            NameRefusedError: The name is empty, longer than 255 bytes, ``.`` or ``..``, or has a
                slash, a backslash, a bar or a NUL in it (A-5-20).
            StoreFullError: There is no room for it.
        """
        if not 1 <= len(name) <= NAME_MAX_BYTES:
            raise NameRefusedError(
                UserMessage(
                    "a name has 1 to {name_max_bytes} bytes, not {name_count}",
                    name_max_bytes=NAME_MAX_BYTES,
                    name_count=len(name),
                )
            )
        if name in (b".", b"..") or not set(name).isdisjoint(b"/\\|\0"):
            raise NameRefusedError(
                UserMessage(
                    "{name} is no name: it has a separator in it, or only dots", name=_show(name)
                )
            )
        others = {other: data for other, data in self._programs.items() if other != name}
        if len(others) >= self._max_files:
            raise StoreFullError(
                UserMessage(
                    "the store holds {max_files} programs and takes no more",
                    max_files=self._max_files,
                )
            )
        free_bytes = self._max_bytes - sum(map(len, others.values()))
        if size_bytes > free_bytes:
            raise StoreFullError(
                UserMessage(
                    "{size_bytes} bytes are too many: {free_bytes} bytes are free",
                    size_bytes=size_bytes,
                    free_bytes=free_bytes,
                )
            )

    def write(self, name: bytes, data: bytes) -> None:
        """Store a program, in place of another one of this name.

        Raises:
            StoreError: As `check`, or the disk failed; then nothing has changed.
        """
        self.check(name, len(data))
        self._programs[name] = data

    def delete(self, name: bytes) -> None:
        """Forget a program.

        Raises:
            StoreError: There is none (`MissingError`), or the disk failed.
        """
        self.read(name)
        del self._programs[name]

    @property
    def settings(self) -> Settings:
        """The present settings."""
        return self._settings

    def save(self, settings: Settings) -> None:
        """Replace the settings.

        Raises:
            StoreError: The disk failed; then nothing has changed.
        """
        self._settings = settings


class DirectoryStore(Store):
    """A store whose content is also in a directory, from which it is read once, at the start.

    The directory holds ``settings.json`` and the programs in ``programs``. It belongs to one
    process at a time. Files in it that the store did not make are left alone.

    Raises:
        StoreError: The directory cannot be used or holds more than the bounds allow, or its
            settings are damaged; nothing in it has been changed then but for leftovers.
    """

    def __init__(
        self, directory: Path, max_bytes: int = MAX_BYTES, max_files: int = MAX_FILES
    ) -> None:
        super().__init__(max_bytes, max_files)
        self._directory = directory
        self._settings_path = directory / "settings.json"
        self._programs_path = directory / "programs"
        with _failing(f"{directory} cannot be used as a store"):
            self._programs_path.mkdir(parents=True, exist_ok=True)
            for leftover in directory.glob(f"{_LEFTOVER}*"):
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
        """Forget a program on disk, then in memory."""
        self.read(name)
        path = self._programs_path / _path_of(name)
        with _failing(f"{_show(name)} cannot be deleted"):
            path.unlink()
            _sync(path.parent)
        super().delete(name)

    def save(self, settings: Settings) -> None:
        """Replace the settings on disk, then in memory."""
        self._put(self._settings_path, _dump_settings(settings))
        super().save(settings)

    def _put(self, path: Path, data: bytes) -> None:
        """Write beside, sync, rename: at no instant is there half a file under the name."""
        with _failing(f"{path} cannot be written"):
            path.parent.mkdir(parents=True, exist_ok=True)
            handle, beside = tempfile.mkstemp(prefix=_LEFTOVER, dir=self._directory)
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(data)
                    file.flush()
                    os.fsync(file.fileno())
                Path(beside).replace(path)
            except OSError:
                Path(beside).unlink(missing_ok=True)
                raise
            _sync(path.parent)


def import_programs(store: Store, folder: Path) -> None:
    """Copy the files of a folder into a store, but for hidden ones and names it already has.

    Raises:
        StoreError: The folder cannot be read, or a file does not fit or has no legal name.
    """
    with _failing(f"the programs in {folder} cannot be read"):
        for path in sorted(folder.iterdir()):
            name = os.fsencode(path.name)
            if path.is_file() and not path.name.startswith(".") and name not in store:
                store.check(name, path.stat().st_size)
                store.write(name, path.read_bytes())


# ---------------------------------------------------------------------- names on disk

_LEFTOVER = ".new-"

# No upper case, so that file systems which ignore it confuse no two names.
_PLAIN = frozenset((string.ascii_lowercase + string.digits + "._-").encode())

# A component of at most 255 characters, as file systems want it: "=", three for a byte, one more.
_COMPONENT_BYTES = 64


def _path_of(name: bytes) -> Path:
    """Where a program is stored: percent-encoded, and cut into nested directories where long.

    A file is ``=...=`` and a directory ``=...+``: the marks keep them apart and hide leading dots,
    trailing dots and the device names of Windows.
    """
    pieces = (name[i : i + _COMPONENT_BYTES] for i in range(0, len(name), _COMPONENT_BYTES))
    *directories, file = (
        "=" + "".join(chr(b) if b in _PLAIN else f"%{b:02x}" for b in piece) for piece in pieces
    )
    return Path(*(directory + "+" for directory in directories), file + "=")


def _name_of(path: Path) -> bytes | None:
    """The name whose path this is; None for a file that is not ours."""
    if not str(path).isascii():
        return None
    name = b"".join(unquote_to_bytes(part[1:-1]) for part in path.parts)
    return name if name and _path_of(name) == path else None


def _show(name: bytes) -> str:
    return repr(name.decode("utf-8", "backslashreplace"))


# ---------------------------------------------------------------------- settings on disk

_VERSION = 1


def _dump_settings(settings: Settings) -> bytes:
    """JSON; bytes that are no UTF-8 become lone surrogates, which come back as the same bytes."""
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
                "{path} does not hold the robot's settings ({error}): repair it, or move it "
                "away to start with the defaults",
                path=path,
                error=error,
            )
        ) from error


def _parse_settings(data: bytes) -> Settings:
    values = json.loads(data)
    if not isinstance(values, dict) or values.pop("version", None) != _VERSION:
        raise ValueError(f"it is not of version {_VERSION}")
    defaults = asdict(Settings())
    if values.keys() != defaults.keys():
        raise ValueError(f"its keys are not version, {', '.join(defaults)}")
    return Settings(**{key: _parse(key, values[key], defaults[key]) for key in defaults})


def _parse(key: str, value: Any, default: object) -> Any:
    """A value of the type of the default."""
    match value, default:
        case str(), str():
            return value
        case str(), bytes():
            return value.encode("utf-8", "surrogateescape")
        case list(), tuple() if len(value) == len(default):
            numbers = tuple(float(v) for v in value if isinstance(v, int | float))
            if len(numbers) == len(default) and all(map(math.isfinite, numbers)):
                return numbers
    raise ValueError(f"{key} cannot be {reprlib.repr(value)}")


# ---------------------------------------------------------------------- the disk


@contextlib.contextmanager
def _failing(what: str) -> Iterator[None]:
    """Tell of a failure of the disk in one sentence."""
    try:
        yield
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        raise (StoreFullError if full else StoreError)(f"{what}: {error.strerror}") from error


def _sync(directory: Path) -> None:
    """Make a new, renamed or deleted entry durable, where directories can be synced."""
    with contextlib.suppress(OSError):
        handle = os.open(directory, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
