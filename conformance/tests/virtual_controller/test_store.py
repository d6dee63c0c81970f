"""The store: stored data, refused data, and the state after a kill."""

import errno
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.virtual_controller.store import (
    DirectoryStore,
    MissingError,
    NameRefusedError,
    Settings,
    Store,
    StoreError,
    StoreFullError,
    import_programs,
)

StoreFactory = Callable[..., Store]

NAMES = st.binary(min_size=1, max_size=255).filter(
    lambda name: name not in (b".", b"..") and not set(name) & set(b"/\\|\0")
)


@pytest.fixture(params=["memory", "directory"])
def make_store(request: pytest.FixtureRequest, tmp_path: Path) -> StoreFactory:
    """Make one kind of store; the one on disk always in the same directory."""
    if request.param == "memory":
        return Store
    return lambda **bounds: DirectoryStore(tmp_path / "data", **bounds)


def test_programs_are_kept_listed_and_deleted(make_store: StoreFactory) -> None:
    """Names are sorted by bytes; writing again replaces (A-4.10-5)."""
    store = make_store()
    for name in (b"b.rob", b"B.rob", b"a.rob", "程序.rob".encode("gb18030")):
        store.write(name, b"old")
        store.write(name, name)
    assert store.names() == sorted([b"b.rob", b"B.rob", b"a.rob", "程序.rob".encode("gb18030")])
    assert all(store.read(name) == name for name in store.names())
    store.delete(b"b.rob")
    assert b"b.rob" not in store
    assert b"B.rob" in store
    with pytest.raises(MissingError, match=r"no program 'b\.rob'"):
        store.delete(b"b.rob")
    with pytest.raises(MissingError):
        store.read(b"b.rob")


@pytest.mark.parametrize(
    "name",
    [
        b"",
        b".",
        b"..",
        b"../pro1.rob",
        b"/etc/passwd",
        b"a/b",
        b"..\\pro1.rob",
        b"a\0.rob",
        b"a|b",
        b"\xaf\x7c",  # a GBK character whose second byte is a bar (A-T-2)
        b"n" * 256,
    ],
)
def test_a_name_that_could_leave_the_store_is_refused(
    make_store: StoreFactory, tmp_path: Path, name: bytes
) -> None:
    """The name is refused, and no file is written anywhere (A-5-20)."""
    store = make_store()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(NameRefusedError):
        store.write(name, b"data")
    assert store.names() == []
    assert sorted(tmp_path.rglob("*")) == before


def test_a_full_store_takes_no_more(make_store: StoreFactory) -> None:
    """The bytes and the number of files are limited; for a replaced file only the new content
    counts."""
    store = make_store(max_bytes=10, max_files=2)
    store.write(b"a", b"12345")
    with pytest.raises(StoreFullError, match="6 bytes needed, 5 bytes free"):
        store.write(b"b", b"123456")
    store.write(b"a", b"1234567890")
    store.write(b"b", b"")
    with pytest.raises(StoreFullError, match="holds 2 programs"):
        store.check(b"c", 0)
    store.check(b"b", 0)
    assert store.names() == [b"a", b"b"]


def test_settings_start_as_documented_and_are_replaced(make_store: StoreFactory) -> None:
    """The password and address of the document are valid until others are saved (L109, L153)."""
    store = make_store()
    assert store.settings.password == b"password"
    assert store.settings.ip == "192.168.1.2"
    store.save(replace(store.settings, default_program=b"pro1.rob"))
    assert store.settings == Settings(default_program=b"pro1.rob")


# ---------------------------------------------------------------------- on disk


@given(st.dictionaries(NAMES, st.binary(max_size=300), max_size=4), st.data())
def test_everything_survives_a_restart(
    tmp_path_factory: pytest.TempPathFactory, programs: dict[bytes, bytes], data: st.DataObject
) -> None:
    """A second store on the directory has the same programs and settings, whatever their names and
    contents."""
    directory = tmp_path_factory.mktemp("data")
    first = DirectoryStore(directory)
    for name, content in programs.items():
        first.write(name, content)
    gone = data.draw(st.sets(st.sampled_from(sorted(programs)))) if programs else set()
    for name in gone:
        first.delete(name)
    settings = Settings(
        password=data.draw(st.binary()),
        default_program=data.draw(st.binary()),
        gripper_center=data.draw(
            st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3)
        ),
    )
    first.save(settings)
    second = DirectoryStore(directory)
    left = {name: content for name, content in programs.items() if name not in gone}
    assert {name: second.read(name) for name in second.names()} == left
    assert second.settings == settings


@given(st.lists(NAMES, min_size=2, max_size=2, unique=True))
def test_no_two_names_share_a_file(
    tmp_path_factory: pytest.TempPathFactory, names: list[bytes]
) -> None:
    """Paths differ even where case is ignored, and no component is too long for a file system."""
    directory = tmp_path_factory.mktemp("data")
    store = DirectoryStore(directory)
    for name in names:
        store.write(name, b"")
    paths = [path.relative_to(directory) for path in directory.rglob("*") if path.is_file()]
    assert len({str(path).lower() for path in paths}) == 2
    assert all(str(path).isascii() and max(map(len, path.parts)) <= 255 for path in paths)


@pytest.mark.parametrize("name", [b"nul", b".hidden", b"end.", b"%2e", b"\xff" * 255, b"=a=", b"A"])
def test_special_names_are_encoded_on_disk(tmp_path: Path, name: bytes) -> None:
    """Device names, dots, percent signs and long names are encoded in file names."""
    DirectoryStore(tmp_path).write(name, b"data")
    assert DirectoryStore(tmp_path).read(name) == b"data"
    assert not {"nul", ".hidden", "end.", "A"} & {path.name for path in tmp_path.rglob("*")}


class Killed(BaseException):
    """The process is killed here: the store must not handle this exception."""


@pytest.mark.parametrize(("module", "step"), [(os, "fsync"), (Path, "replace")])
@pytest.mark.parametrize(
    "write",
    [
        lambda store: store.write(b"pro1.rob", b"new and longer"),
        lambda store: store.save(Settings(password=b"new")),
    ],
    ids=["program", "settings"],
)
def test_a_killed_process_leaves_the_old_content(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    module: object,
    step: str,
    write: Callable[[Store], None],
) -> None:
    """After a kill before the rename, a restart has the old file and no temporary file."""
    store = DirectoryStore(tmp_path)
    store.write(b"pro1.rob", b"old")

    def die(*_: object) -> NoReturn:
        raise Killed

    with monkeypatch.context() as patch:
        patch.setattr(module, step, die)
        with pytest.raises(Killed):
            write(store)
    assert list(tmp_path.glob(".new-*"))
    again = DirectoryStore(tmp_path)
    assert again.read(b"pro1.rob") == b"old"
    assert again.settings == Settings()
    assert not list(tmp_path.glob(".new-*"))


@pytest.mark.parametrize(
    ("number", "expected"), [(errno.ENOSPC, StoreFullError), (errno.EIO, StoreError)]
)
def test_a_failed_write_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, expected: type[StoreError]
) -> None:
    """A failed write raises an error of one sentence; memory and disk are unchanged."""
    store = DirectoryStore(tmp_path)
    store.write(b"pro1.rob", b"old")

    def fail(_: int) -> NoReturn:
        raise OSError(number, os.strerror(number))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", fail)
        with pytest.raises(expected, match="cannot be written") as error:
            store.write(b"pro1.rob", b"new")
        with pytest.raises(expected):
            store.save(Settings(password=b"new"))
    assert type(error.value) is expected
    assert store.read(b"pro1.rob") == DirectoryStore(tmp_path).read(b"pro1.rob") == b"old"
    assert store.settings == DirectoryStore(tmp_path).settings == Settings()
    assert not list(tmp_path.glob(".new-*"))


@pytest.mark.parametrize(
    "damage",
    [
        b"",
        b"{",
        b"[]",
        b"\xff\xfe",
        b"[" * 100_000,
        b'{"version": 2}',
        b'{"version": 1}',
    ],
)
def test_damaged_settings_are_an_error_and_kept(tmp_path: Path, damage: bytes) -> None:
    """One sentence says what to do, and the file stays as it is."""
    path = tmp_path / "settings.json"
    path.write_bytes(damage)
    with pytest.raises(StoreError, match="repair it, or move it away") as error:
        DirectoryStore(tmp_path)
    assert "\n" not in str(error.value)
    assert path.read_bytes() == damage


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"password": "password"', '"password": 1'),
        ('"password": "password"', '"password": "\\ud800"'),
        ('"password": "password"', '"secret": "password"'),
        ('"ip": "192.168.1.2"', '"ip": []'),
        ("300.0", "NaN"),
        ("300.0", "1" + "0" * 400),
        ("300.0,", ""),
        ("300.0", '"300"'),
    ],
)
def test_settings_of_a_wrong_type_are_an_error(tmp_path: Path, old: str, new: str) -> None:
    """A value of the wrong type is an error, like a truncated file."""
    DirectoryStore(tmp_path).save(Settings())
    path = tmp_path / "settings.json"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(StoreError, match=r"settings\.json is not a valid settings file"):
        DirectoryStore(tmp_path)


def test_other_files_are_not_changed(tmp_path: Path) -> None:
    """Files of other programs are neither listed nor removed."""
    DirectoryStore(tmp_path).write(b"pro1.rob", b"data")
    foreign = [tmp_path / "programs" / name for name in ("README", "=A=", "=a+", "程序", "=%61=")]
    for path in foreign:
        path.write_bytes(b"mine")
    (tmp_path / "programs" / "=directory=").mkdir()
    assert DirectoryStore(tmp_path).names() == [b"pro1.rob"]
    assert all(path.read_bytes() == b"mine" for path in foreign)


def test_a_directory_beyond_the_limits_is_not_read(tmp_path: Path) -> None:
    """The limits also apply at the start."""
    DirectoryStore(tmp_path).write(b"pro1.rob", b"12345")
    with pytest.raises(StoreFullError, match="5 bytes needed, 4 bytes free"):
        DirectoryStore(tmp_path, max_bytes=4)


def test_a_file_instead_of_a_directory_is_an_error(tmp_path: Path) -> None:
    """The sentence names it."""
    path = tmp_path / "data"
    path.write_bytes(b"")
    with pytest.raises(StoreError, match="data cannot be used as a store: "):
        DirectoryStore(path)


# ---------------------------------------------------------------------- seeding


def test_a_folder_of_programs_is_copied_in(make_store: StoreFactory, tmp_path: Path) -> None:
    """Files are copied with their names, but not hidden files, folders and names that exist
    already."""
    folder = tmp_path / "programs to seed"
    (folder / "sub").mkdir(parents=True)
    (folder / "pro1.rob").write_bytes(b"seed 1")
    (folder / "pro2.rob").write_bytes(b"seed 2")
    (folder / ".hidden").write_bytes(b"")
    store = make_store()
    store.write(b"pro2.rob", b"uploaded")
    import_programs(store, folder)
    assert {name: store.read(name) for name in store.names()} == {
        b"pro1.rob": b"seed 1",
        b"pro2.rob": b"uploaded",
    }


def test_an_unreadable_program_folder_is_an_error(make_store: StoreFactory, tmp_path: Path) -> None:
    """A missing folder and one that is too large each give one sentence."""
    with pytest.raises(StoreError, match="nowhere cannot be read"):
        import_programs(make_store(), tmp_path / "nowhere")
    (tmp_path / "large.rob").write_bytes(b"12345")
    with pytest.raises(StoreFullError):
        import_programs(make_store(max_bytes=4), tmp_path)
