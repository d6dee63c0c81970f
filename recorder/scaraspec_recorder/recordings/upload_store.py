"""The store of uploaded recordings: a folder, or an object storage that fsspec knows.

The file of a recording is ``ROBOT/YYYY-MM-DD/FILE`` in it. A reader never sees a part of a file. If
the store has another file of this name, that one is kept, and the new file is
``ROBOT/YYYY-MM-DD/SHA256/FILE``.
"""

import hashlib
import os
import re
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from io import FileIO
from pathlib import Path
from typing import Any, Final

from scaraspec.user_message import UserMessage
from scaraspec_recorder.sinks.file_names import safe_name

SHA256: Final = "[0-9a-f]{64}"

_WHOLE_PUTS: Final = ("s3", "s3a")  # what they store is visible when it is whole
_BLOCK_BYTES: Final = 8 << 20  # S3 stores parts of at least 5 MiB
_PIECE_BYTES: Final = 256 << 10
_SECRETS: Final = re.compile(r"//[^/@]*@")


def parse_store_url(text: str) -> str:
    """Check the path or URL of a store. The store is not contacted.

    Raises:
        ValueError: It is not a path or URL that can be used. The message is one sentence.
    """
    try:
        from fsspec import get_filesystem_class  # type: ignore[import-untyped]  # noqa: PLC0415 - an optional extra that ships no types
        from fsspec.utils import get_protocol  # type: ignore[import-untyped]  # noqa: PLC0415 - as above
    except ImportError:
        raise ValueError("uploads need the extra: pip install 'scaraspec[archive]'") from None
    try:
        get_filesystem_class(get_protocol(text))
    except (ValueError, ImportError) as error:
        raise ValueError(
            UserMessage("{url} cannot be used: {reason}", url=without_secrets(text), reason=error)
        ) from None
    return text


def without_secrets(text: str) -> str:
    """Return a text without the user names and passwords of its URLs."""
    return _SECRETS.sub("//", text)


def robot_of(name: str, robot: str) -> str:
    """Return the robot of a recording.

    A second recording of the same second has ``-2`` at the end of its name.

    Args:
        name: The name of its file.
        robot: The robot that the recorder records now.
    """
    named, own = Path(name).stem.partition("_")[2], safe_name(robot)
    return own if re.fullmatch(re.escape(own) + r"(-\d+)?", named) else named


class Pace:
    """Keeps to a rate by pauses.

    Args:
        rate_bytes: The rate, in bytes a second.
        monotonic: A clock in seconds.
        sleep: Waits for seconds.

    Attributes:
        rate_bytes: The rate.
    """

    def __init__(
        self,
        rate_bytes: int,
        monotonic: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.rate_bytes = rate_bytes
        self._monotonic = monotonic
        self._sleep = sleep
        self._due_s = 0.0

    def spend(self, size_bytes: int) -> None:
        """Wait until these bytes fit in the rate."""
        now_s = self._monotonic()
        self._due_s = max(self._due_s, now_s) + size_bytes / self.rate_bytes
        self._sleep(self._due_s - now_s)


class UploadStore:
    """A store that recordings are uploaded to.

    Exceptions of the libraries by which fsspec reaches the store are not caught.

    Args:
        url: Its path or URL.
        token: Distinguishes the temporary files of this recorder from those of others.
        pace: Limits the rate.
        on_progress: Called after each piece of a file; it may raise to end the upload.
    """

    def __init__(
        self, url: str, token: str, pace: Pace, on_progress: Callable[[], None] = lambda: None
    ) -> None:
        from fsspec.core import url_to_fs  # type: ignore[import-untyped]  # noqa: PLC0415 - as above

        self._fs, self._root = url_to_fs(url)
        self._token = token
        self._pace = pace
        self._piece_bytes = min(_PIECE_BYTES, pace.rate_bytes)  # a second's: it can end in between
        self._on_progress = on_progress
        protocols = self._fs.protocol
        protocols = {protocols} if isinstance(protocols, str) else {*protocols}
        self._puts_whole = not protocols.isdisjoint(_WHOLE_PUTS)
        self._is_local = "file" in protocols

    def put(self, path: Path, robot: str) -> tuple[str, bool]:
        """Store a recording, unless the store has it already.

        Args:
            path: Its file.
            robot: The name of its robot.

        Returns:
            The path in the store, and whether it differs from the usual one.

        Raises:
            OSError: Also exceptions of the libraries: the file cannot be stored.
        """
        if not self._puts_whole and not self._fs.isdir(self._root):  # it may be an unmounted disk
            raise NotADirectoryError(
                UserMessage("{path} is not a folder: create it", path=self._root)
            )
        with path.open("rb", buffering=0) as file:
            for number, target in enumerate(self._targets(path.name, robot, file)):
                self._fs.invalidate_cache()
                if not self._fs.exists(target):
                    self._copy(file, target)
                elif not self._is_equal(file, target):
                    continue
                return self._fs.unstrip_protocol(target), number > 0
        raise FileExistsError(UserMessage("{path} has other content", path=target))

    def _targets(self, name: str, robot: str, file: FileIO) -> Iterator[str]:
        """Yield the possible paths of a file."""
        folder = f"{self._root}/{robot}/{name[:10]}"
        yield f"{folder}/{name}"
        file.seek(0)
        yield f"{folder}/{hashlib.file_digest(file, 'sha256').hexdigest()}/{name}"

    def _is_equal(self, file: FileIO, target: str) -> bool:
        """Whether the store has this content."""
        if self._size_bytes(target) != os.fstat(file.fileno()).st_size:
            return False
        file.seek(0)
        with self._fs.open(target, "rb", block_size=_PIECE_BYTES) as stored:
            return all(stored.read(len(piece)) == piece for piece in self._pieces(file))

    def _copy(self, file: FileIO, target: str) -> None:
        if self._puts_whole:
            self._send(file, target)
            return
        folder, _, name = target.rpartition("/")
        temporary = f"{folder}/.{name}.{self._token}.part"
        self._fs.makedirs(folder, exist_ok=True)
        self._send(file, temporary)
        self._fs.mv(temporary, target)

    def _send(self, file: FileIO, path: str) -> None:
        """Write a file of the store, and check its size."""
        file.seek(0)
        stored = self._fs.open(path, "wb", block_size=_BLOCK_BYTES)
        try:
            for piece in self._pieces(file):
                stored.write(piece)
            if self._is_local:
                stored.flush()
                os.fsync(stored.fileno())
            stored.close()
        except BaseException:
            self._give_up(stored)
            raise
        self._fs.invalidate_cache()
        size_bytes = self._size_bytes(path)
        if size_bytes != file.tell():
            raise OSError(
                UserMessage(
                    "{path} has {size} of {expected} bytes",
                    path=path,
                    size=size_bytes,
                    expected=file.tell(),
                )
            )

    def _give_up(self, stored: Any) -> None:
        """Release a file of the store that cannot be completed."""
        with suppress(Exception):  # the first error is reported
            if not self._puts_whole:
                stored.close()
                return
            stored.closed = True  # else its destructor would complete it
            stored.discard()

    def _pieces(self, file: FileIO) -> Iterator[bytes]:
        """Yield the content of a file at the permitted rate."""
        while piece := file.read(self._piece_bytes):
            self._pace.spend(len(piece))
            self._on_progress()
            yield piece

    def _size_bytes(self, path: str) -> int:
        size_bytes: int = self._fs.info(path)["size"]
        return size_bytes
