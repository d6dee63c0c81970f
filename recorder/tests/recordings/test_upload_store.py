"""The store of uploaded recordings: nothing is there in part, and nothing is overwritten."""

from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

import pytest

from scaraspec_recorder.recordings.upload_store import (
    Pace,
    UploadStore,
    parse_store_url,
    robot_of,
    without_secrets,
)

pytest.importorskip("fsspec")

NAME = "2026-11-20T23-59-59Z_line-3.mcap"
USUAL = Path("line-3", "2026-11-20", NAME)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """The folder of a store."""
    root = tmp_path / "store"
    root.mkdir()
    return root


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A file that is stored in several pieces."""
    path = tmp_path / NAME
    path.write_bytes(bytes(range(251)) * 4000)
    return path


def put(root: Path, recording: Path) -> tuple[str, bool]:
    store = UploadStore(f"file://{root}", "token", Pace(10**12))
    return store.put(recording, "line-3")


def files(root: Path) -> dict[Path, bytes]:
    return {path.relative_to(root): path.read_bytes() for path in root.rglob("*") if path.is_file()}


def test_the_layout(root: Path, recording: Path) -> None:
    """By robot and day. A second upload changes nothing."""
    expected = f"file://{root / USUAL}", False
    assert put(root, recording) == expected
    before = (root / USUAL).stat()
    assert put(root, recording) == expected
    assert files(root) == {USUAL: recording.read_bytes()}
    assert (root / USUAL).stat() == before


@pytest.mark.parametrize("other", [b"other", bytes(251 * 4000)])
def test_another_file_of_this_name(root: Path, recording: Path, other: bytes) -> None:
    """It is kept. The recording gets a name that depends on its content."""
    (root / USUAL.parent).mkdir(parents=True)
    (root / USUAL).write_bytes(other)
    content = recording.read_bytes()
    second = USUAL.parent / sha256(content).hexdigest() / NAME
    for _ in range(2):
        assert put(root, recording) == (f"file://{root / second}", True)
        assert files(root) == {USUAL: other, second: content}
    (root / second).write_bytes(b"damaged")
    with pytest.raises(FileExistsError, match="has other content"):
        put(root, recording)


def test_an_interrupted_upload(root: Path, recording: Path) -> None:
    """No part is visible under the name of the recording. The next upload replaces it."""
    pieces = iter((None, None, ConnectionError("reset")))

    def interrupt() -> None:
        if error := next(pieces):
            raise error

    store = UploadStore(f"file://{root}", "token", Pace(10**12), interrupt)
    with pytest.raises(ConnectionError):
        store.put(recording, "line-3")
    (part,) = files(root)
    assert part.name == f".{NAME}.token.part"
    put(root, recording)
    assert files(root) == {USUAL: recording.read_bytes()}


def test_a_store_that_loses_bytes(
    root: Path, recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The size is compared before the file gets its name."""
    from fsspec.implementations.local import LocalFileOpener  # type: ignore[import-untyped]  # noqa: PLC0415 - an extra that ships no types

    write = LocalFileOpener.write
    monkeypatch.setattr(LocalFileOpener, "write", lambda self, data: write(self, data[1:]))
    with pytest.raises(OSError, match="has 1003996 of 1004000 bytes"):
        put(root, recording)
    assert USUAL not in files(root)


def test_a_folder_that_is_not_there(tmp_path: Path, recording: Path) -> None:
    """It may be on a disk that is not mounted: it is not created."""
    with pytest.raises(NotADirectoryError, match="is not a folder: create it"):
        put(tmp_path / "unmounted", recording)
    assert not (tmp_path / "unmounted").exists()


def test_the_rate() -> None:
    """Pauses are as long as the pieces need."""
    now_s, pauses_s = 100.0, list[float]()

    def sleep(time_s: float) -> None:
        nonlocal now_s
        pauses_s.append(time_s)
        now_s += time_s

    pace = Pace(1000, lambda: now_s, sleep)
    for _ in range(3):
        pace.spend(500)
        now_s += 0.2
    now_s += 60
    pace.spend(250)
    assert pauses_s == pytest.approx([0.5, 0.5, 0.5, 0.25])


@pytest.mark.parametrize(
    ("name", "robot", "expected"),
    [
        (NAME, "line-3", "line-3"),
        ("2026-11-20T23-59-59Z_line-3-2.mcap", "line-3", "line-3"),
        ("2026-11-20T23-59-59Z_line-4.mcap", "line-3", "line-4"),
        ("2026-11-20T23-59-59Z_cell-2.mcap", "cell 2", "cell-2"),
    ],
)
def test_the_robot_of_a_recording(name: str, robot: str, expected: str) -> None:
    """That of its file name, without the number of files of one second."""
    assert robot_of(name, robot) == expected


@pytest.mark.parametrize("url", ["s4://bucket", "nil://user:word@host"])
def test_an_unknown_kind_of_store(url: str) -> None:
    """The message has no password."""
    with pytest.raises(ValueError, match="cannot be used: Protocol not known") as error:
        parse_store_url(url)
    assert "word" not in str(error.value)


def test_secrets_are_not_shown() -> None:
    text = "sftp://user:word@host/x: no route to ftp://a@b"
    assert without_secrets(text) == "sftp://host/x: no route to ftp://b"


@pytest.fixture(autouse=True)
def no_temporary_files(tmp_path: Path) -> Iterator[None]:
    """Nothing is written outside of the store."""
    yield
    assert {path.name for path in tmp_path.iterdir()} <= {"store", NAME}
