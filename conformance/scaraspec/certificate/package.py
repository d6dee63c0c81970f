"""Result package: a ZIP archive with a manifest; how it is written and read.

A package is hostile input: only the known names are read, each once and up to a limit.
"""

import hashlib
import json
import os
import shutil
import stat
import struct
import zipfile
import zlib
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import BinaryIO, Final

from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.codec import from_plain, to_plain
from scaraspec.report.model import Results, Role, Tool
from scaraspec.user_message import UserMessage

SCHEMA: Final = "scaraspec.package/1"
SUFFIX: Final = ".scaraspec.zip"
MANIFEST: Final = "manifest.json"
CAPTURE: Final = "capture.mcap"
RESULTS: Final = "results.json"
FILES: Final = (
    RESULTS,
    "report.html",
    "junit.xml",
    "ctrf.json",
    CAPTURE,
    "ics.json",
    "settings.json",
    "environment.json",
    "calibration.json",
)
"""The files of a package besides the manifest."""

_NAMES: Final = frozenset({*FILES, MANIFEST})
_EPOCH: Final = (1980, 1, 1, 0, 0, 0)
_MODE: Final = stat.S_IFREG | 0o644
_UNIX: Final = 3
_CHUNK_BYTES: Final = 1 << 20
_MAX_BYTES: Final = 2**30
"""The limit of all files together, and of the package itself."""
_MAX_TEXT_BYTES: Final = 64 * 2**20
"""The limit of a file that is read as a whole."""
_END: Final = struct.Struct("<4s4H2LH")
"""The end of a ZIP archive: signature, disks, entries, directory size and offset, comment."""
_END_SIGNATURE: Final = b"PK\5\6"
_ZIP64_SIGNATURE: Final = b"PK\6\7"
_ZIP64_BYTES: Final = 20
_MAX_DIRECTORY_BYTES: Final = 64 * 2**10


class PackageError(Exception):
    """A package cannot be read, or contains what no package may contain.

    Attributes:
        exit_status: The exit status of `scaraspec verify`.
    """

    def __init__(self, sentence: str, exit_status: ExitStatus) -> None:
        super().__init__(sentence)
        self.exit_status = exit_status


@dataclass(frozen=True, slots=True)
class File:
    """A file of a package."""

    sha256: str
    size_bytes: int


@dataclass(frozen=True, slots=True)
class Manifest:
    """What a package consists of.

    Attributes:
        tool: The tool that made it.
        role: The role of the SUT.
        mandatory_id: The id of the list of mandatory cases.
        mandatory_sha256: The checksum of this list.
        files: The files by name.
        cases: The checksum of each case in results.json by id; see `case_sums`.
    """

    tool: Tool
    role: Role
    mandatory_id: str
    mandatory_sha256: str
    files: Mapping[str, File]
    cases: Mapping[str, str]

    def to_json(self) -> str:
        """Return the text of manifest.json; equal manifests give equal bytes."""
        return plain_json({"schema": SCHEMA, **to_plain(self)})


def plain_json(plain: object) -> str:
    """Return the text of a JSON file with sorted keys."""
    return json.dumps(plain, ensure_ascii=False, indent=1, sort_keys=True) + "\n"


def case_sums(results: Results) -> dict[str, str]:
    """Return the SHA-256 checksum of each case by id; cases with one id have one checksum."""
    texts: defaultdict[str, str] = defaultdict(str)
    for case in results.cases:
        texts[case.id] += plain_json(to_plain(case))
    return {
        case_id: hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
        for case_id, text in texts.items()
    }


def file_of(path: Path) -> File:
    """Return the manifest entry of a file.

    Raises:
        OSError: The file cannot be read.
    """
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256")
        return File(digest.hexdigest(), file.tell())


def sha256_of(file: BufferedReader) -> str:
    """Return the SHA-256 checksum of an open file."""
    file.seek(0)
    return hashlib.file_digest(file, "sha256").hexdigest()


def obstacle(path: Path) -> str:
    """Return why a package cannot be written; empty if nothing is known."""
    if path.exists():
        return UserMessage("{package} exists: name another file with --package", package=path)
    folder = next(each for each in path.absolute().parents if each.exists())
    if folder.is_dir() and os.access(folder, os.W_OK | os.X_OK):
        return ""
    return UserMessage(
        "{package} cannot be written: name another file with --package", package=path
    )


def write(path: Path, files: Mapping[str, Path]) -> None:
    """Write a new package; equal files give equal bytes.

    Args:
        path: The package; it must not exist. Its folder is created.
        files: The manifest and the other files, by their names in the package.

    Raises:
        OSError: The package exists or cannot be written, or a file cannot be read.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    file = path.open("xb")
    try:
        with file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in sorted(files):
                entry = zipfile.ZipInfo(name, _EPOCH)
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.create_system = _UNIX
                entry.external_attr = _MODE << 16
                with files[name].open("rb") as source, archive.open(entry, "w") as target:
                    shutil.copyfileobj(source, target)
    except BaseException:
        path.unlink()  # after it is closed: Windows removes no open file
        raise


def extract(file: BinaryIO, folder: Path) -> frozenset[str]:
    """Extract a package into an empty folder, and return the names of its files.

    Raises:
        PackageError: The file is not a package, or contains what no package may contain.
        OSError: The folder cannot be written.
    """
    _require_plain_end(file)
    try:
        with zipfile.ZipFile(file) as archive:
            entries = archive.infolist()
            _require_known(entries)
            _require_limits(entries)
            for entry in entries:
                with archive.open(entry) as source, (folder / entry.filename).open("xb") as target:
                    shutil.copyfileobj(source, target)
    except (zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError) as error:
        raise _unreadable(error) from None
    return frozenset(entry.filename for entry in entries)


def _require_plain_end(file: BinaryIO) -> None:
    """Require that the archive ends as `write` ends it, with a small directory.

    `zipfile` reads the whole directory, whatever its size.
    """
    size_bytes = file.seek(0, 2)
    if size_bytes > _MAX_BYTES:
        raise _refused("it is larger than 1 GiB")
    file.seek(max(0, size_bytes - _END.size - _ZIP64_BYTES))
    tail = file.read()
    end, before = tail[-_END.size :], tail[: -_END.size]
    if len(end) < _END.size or not end.startswith(_END_SIGNATURE):
        raise _unreadable("it does not end as a ZIP archive without a comment does")
    if before.startswith(_ZIP64_SIGNATURE) or _END.unpack(end)[5] > _MAX_DIRECTORY_BYTES:
        raise _refused("its directory is too large")


def _require_known(entries: Sequence[zipfile.ZipInfo]) -> None:
    """Require that an archive contains only regular files of a package, each once."""
    for name, count in Counter(entry.filename for entry in entries).items():
        if name not in _NAMES:
            raise _refused(UserMessage("no package contains a file {name!r}", name=name))
        if count > 1:
            raise _refused(UserMessage("it contains {name} {count} times", name=name, count=count))
    for entry in entries:
        if stat.S_IFMT(entry.external_attr >> 16) not in (0, stat.S_IFREG):
            raise _refused(UserMessage("{name} is not a regular file", name=entry.filename))
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise _refused(UserMessage("{name} is compressed otherwise", name=entry.filename))
    if MANIFEST not in {entry.filename for entry in entries}:
        raise _refused(UserMessage("{name} is missing", name=MANIFEST))


def _require_limits(entries: Sequence[zipfile.ZipInfo]) -> None:
    """Require that an archive begins with its first file, and that no file is too large."""
    if min(entry.header_offset for entry in entries):
        raise _refused("there are other bytes before its first file")
    for entry in entries:
        limit_bytes = _MAX_BYTES if entry.filename == CAPTURE else _MAX_TEXT_BYTES
        if entry.file_size > limit_bytes:
            raise _refused(UserMessage("{name} is too large", name=entry.filename))
    if sum(entry.file_size for entry in entries) > _MAX_BYTES:
        raise _refused("its files are larger than 1 GiB")


def _refused(reason: str) -> PackageError:
    return PackageError(
        UserMessage.joined("the package is refused: ", "{reason}", reason=reason),
        ExitStatus.NONCONFORMANT,
    )


def _unreadable(reason: object) -> PackageError:
    return PackageError(
        UserMessage("it is not a package, or it is damaged: {reason}", reason=reason),
        ExitStatus.USAGE,
    )


def read_manifest(folder: Path) -> Manifest:
    """Read the manifest of an extracted package.

    Raises:
        PackageError: It is not what this version, or a known one, writes.
    """
    schema: object = None
    try:
        text = (folder / MANIFEST).read_bytes().decode("utf-8")
        plain = json.loads(text)
        schema = plain.get("schema") if isinstance(plain, dict) else None
        if schema == SCHEMA and (manifest := from_plain(Manifest, plain)).to_json() == text:
            return manifest
    except (ValueError, RecursionError):
        pass
    if isinstance(schema, str) and schema != SCHEMA and schema.startswith("scaraspec.package/"):
        raise PackageError(
            UserMessage(
                "{name} has the schema {schema!r}, which this version does not read: use the "
                "version that made the package",
                name=MANIFEST,
                schema=schema[:40],
            ),
            ExitStatus.INCONCLUSIVE,
        )
    raise _refused(UserMessage("{name} is altered or damaged", name=MANIFEST))


def json_in(path: Path) -> Mapping[str, object]:
    """Return the object in a JSON file; empty if there is none."""
    try:
        plain = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return plain if isinstance(plain, dict) else {}


def file_problems(
    folder: Path, names: frozenset[str], manifest: Manifest, results: Results | None
) -> Iterator[str]:
    """Yield each difference between the files and the manifest, and each altered case."""
    for name in FILES:
        if name not in names or name not in manifest.files:
            yield UserMessage("{name} is missing", name=name)
        elif file_of(folder / name) != manifest.files[name]:
            yield UserMessage("{name} was changed", name=name)
    for name in sorted(manifest.files.keys() - {*FILES}):
        yield UserMessage("the manifest has a file {name!r}, which no package has", name=name)
    if results is None:
        yield UserMessage("{name} cannot be read", name=RESULTS)
        return
    sums = case_sums(results)
    for case_id in sorted(sums.keys() | manifest.cases.keys()):
        if case_id not in sums:
            yield UserMessage("case {case} was removed", case=case_id)
        elif case_id not in manifest.cases:
            yield UserMessage("case {case} was added", case=case_id)
        elif sums[case_id] != manifest.cases[case_id]:
            yield UserMessage("case {case} was altered", case=case_id)
