"""A small disk that can be full or read-only: a file system in memory.

It is visible only to this process and its children. It needs root or a user namespace: see
`make test-net`.
"""

import ctypes
import os
from contextlib import suppress
from pathlib import Path

DISK_BYTES = 16 << 20

_CLONE_NEWNS = 0x20000
_MS_RDONLY, _MS_REMOUNT, _MS_REC, _MS_PRIVATE = 0x1, 0x20, 0x4000, 0x40000
_libc = ctypes.CDLL(None, use_errno=True)


def _mount(kind: str, where: Path, flags: int, options: str = "") -> None:
    arguments = (kind.encode(), str(where).encode(), kind.encode(), flags, options.encode())
    if _libc.mount(*arguments):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()), str(where))


class Disk:
    """A small file system for the recorder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._ballast = folder / "ballast"
        if _libc.unshare(_CLONE_NEWNS):
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
        _mount("none", Path("/"), _MS_REC | _MS_PRIVATE)
        _mount("tmpfs", folder, 0, f"size={DISK_BYTES}")

    def fill(self) -> None:
        with suppress(OSError), self._ballast.open("ab", buffering=0) as file:
            while True:
                file.write(bytes(4096))

    def clear(self) -> None:
        if self._ballast.exists():  # on a read-only disk, not even a missing file can be unlinked
            self._ballast.unlink()

    def allow_writing(self, *, allowed: bool) -> None:
        flags = _MS_REMOUNT | (0 if allowed else _MS_RDONLY)
        _mount("tmpfs", self.folder, flags, f"size={DISK_BYTES}")
