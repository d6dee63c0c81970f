"""`scaraspec verify`: the files of a package, hostile archives, and the signature."""

import hashlib
import json
import re
import shlex
import shutil
import stat
import subprocess
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from certification import (
    ICS,
    Verify,
    certification_of,
    list_of_cases,
    plain_in,
    rezipped,
)
from wording import ROOT

from scaraspec import version
from scaraspec.api.certificates import PackageError, verify_package, write_package
from scaraspec.certificate.environment import environment
from scaraspec.certificate.mandatory import MandatoryList
from scaraspec.certificate.package import FILES, MANIFEST, plain_json
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.model import Results, Tool
from scaraspec.suite.engine.hooks import CommandHook

NAMES = sorted((*FILES, MANIFEST))


@pytest.fixture(scope="session")
def key(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a new private key."""
    path = tmp_path_factory.mktemp("keys") / "laboratory"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", path], check=True)
    return path


def sign(path: Path, key: Path) -> None:
    subprocess.run(
        ["ssh-keygen", "-q", "-Y", "sign", "-n", "scaraspec", "-f", key, path],
        check=True,
        capture_output=True,
    )


@pytest.fixture
def copy(package: Path, tmp_path: Path) -> Path:
    """Return a copy of the package, without a signature."""
    return Path(shutil.copy(package, tmp_path))


def outcome(path: Path, mandatory: MandatoryList) -> tuple[ExitStatus, tuple[str, ...]]:
    """Return the exit status for a package, and the problems."""
    try:
        verification = verify_package(path, lists=[mandatory])
    except PackageError as error:
        return error.exit_status, (f"{error}",)
    return verification.exit_status, tuple(p for each in verification.checks for p in each.problems)


def test_verified(verify: Verify, package: Path) -> None:
    """A package as it was written: every check passes, and the missing signature is stated."""
    status, text = verify(package)
    assert status == 0, text
    assert "REFUSED" not in text
    assert text.splitlines()[-1] == (
        f"{package}: verified, unsigned: Cell 7 1.4: "
        "no violation found (7 of 9 requirements judged)"
    )


def test_equal_content_gives_equal_bytes(
    package: Path, run_folder: Path, small_list: MandatoryList, tmp_path: Path
) -> None:
    again = tmp_path / "again.scaraspec.zip"
    write_package(certification_of(again, small_list), run_folder, ICS)
    assert again.read_bytes() == package.read_bytes()


def test_nothing_is_overwritten(package: Path, run_folder: Path, small_list: MandatoryList) -> None:
    before = package.read_bytes()
    with pytest.raises(FileExistsError):
        write_package(certification_of(package, small_list), run_folder, ICS)
    assert package.read_bytes() == before


def test_no_password(package: Path) -> None:
    """The password of the controller is in no file, not even in the raw bytes of the capture."""
    with zipfile.ZipFile(package) as archive:
        for name in set(NAMES) - {"report.html"}:  # it explains what a password is
            assert b"|password" not in archive.read(name)
            assert b"\x01\x08password" not in archive.read(name)


def test_environment(package: Path) -> None:
    """Who tested which sample, where, and with what."""
    found: Any = plain_in(package, "environment.json")
    assert found["sample"] == {"serial_number": "7", "firmware": "1.4", "hardware": "B"}
    assert found["laboratory"] == {"name": "Lab", "operator": "Li"}
    machine = {"host", "operating_system", "python", "clock"}
    assert {key for key, text in found["machine"].items() if text} == machine
    assert found["tool"]["version"] == Tool.own().version
    assert found["round_trip"]["command"] == "get_status"
    assert found["round_trip"]["count"] > 0


def test_commit_of_an_installed_tool(
    run_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An installation has no checkout: the commit is the one that the wheel states."""
    (tmp_path / "commit").write_text("0123456789ab\n")
    monkeypatch.setattr(version, "_BUILT", tmp_path / "commit")
    found: Any = environment(ICS, Results.read(run_folder / "results.json"))
    assert found["tool"]["commit"] == "0123456789ab"
    assert version.version_text().endswith(" (commit 0123456789ab)")


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"sample": 5}, "environment.json is damaged: "),
        ({"sample": {}}, "sample.serial_number is missing"),
        ({"laboratory": {"name": "Other", "operator": "Li"}}, "ics.json has another laboratory"),
        (
            {"machine": {"host": "a", "python": "3", "clock": ""}},
            "machine.operating_system is missing",
        ),
        ({"tool": {"version": "9"}}, "results.json has another version of scaraspec or Python"),
        ({"round_trip": {}}, "environment.json has another round trip than the results"),
    ],
)
def test_other_environment(
    package: Path,
    small_list: MandatoryList,
    tmp_path: Path,
    changes: dict[str, object],
    problem: str,
) -> None:
    """A certificate needs the sample and the laboratory of the ICS."""
    text = json.dumps({**plain_in(package, "environment.json"), **changes}).encode()
    manifest: Any = plain_in(package, MANIFEST)
    manifest["files"]["environment.json"] = {
        "sha256": hashlib.sha256(text).hexdigest(),
        "size_bytes": len(text),
    }
    path = rezipped(
        package,
        tmp_path / "changed.zip",
        environment__json=text,
        manifest__json=plain_json(manifest).encode(),
    )
    status, problems = outcome(path, small_list)
    assert status is ExitStatus.NONCONFORMANT
    assert any(each.startswith(problem) for each in problems)


def test_hooks_only_by_name(run_folder: Path, tmp_path: Path) -> None:
    """The command of a hook may contain a password."""
    ics = replace(ICS, hooks={"restart": CommandHook("restart", "ssh -p secret", 1.0)})
    path = tmp_path / "package.zip"
    write_package(certification_of(path, list_of_cases()), run_folder, ics)
    assert plain_in(path, "ics.json")["claims"] == {"hooks.restart": "given"}
    with zipfile.ZipFile(path) as archive:
        assert not any(b"secret" in archive.read(name) for name in ("ics.json", "environment.json"))


# Files.


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("place", [0.0, 0.5, 1.0])
def test_each_changed_file(
    package: Path, small_list: MandatoryList, tmp_path: Path, name: str, place: float
) -> None:
    """A single changed byte in any file is found, and the file is named."""
    with zipfile.ZipFile(package) as archive:
        data = bytearray(archive.read(name))
    data[int(place * (len(data) - 1))] ^= 1
    path = rezipped(package, tmp_path / "changed.zip", **{name: bytes(data)})
    status, problems = outcome(path, small_list)
    assert status is ExitStatus.NONCONFORMANT
    assert f"{name} was changed" in problems


@pytest.mark.parametrize("name", NAMES)
def test_each_missing_file(verify: Verify, package: Path, tmp_path: Path, name: str) -> None:
    path = rezipped(package, tmp_path / "changed.zip", **{name: None})
    status, text = verify(path)
    assert status == 1
    assert f"{name} is missing" in text


def _leaves(plain: object, change: Callable[[object], object]) -> Iterator[object]:
    """Yield copies of a document, each with one changed value or one removed key."""
    if isinstance(plain, dict):
        for key, value in plain.items():
            yield {k: v for k, v in plain.items() if k != key}
            for changed in _leaves(value, change):
                yield {**plain, key: changed}
    else:
        yield change(plain)


def test_each_change_of_the_manifest(
    package: Path, small_list: MandatoryList, tmp_path: Path
) -> None:
    """The manifest has no checksum of its own: each of its values is checked."""
    plain = plain_in(package, MANIFEST)
    count = 0
    for changed in _leaves(plain, lambda v: v + 1 if isinstance(v, int) else f"{v}0"):
        text = json.dumps(changed, ensure_ascii=False, indent=1, sort_keys=True) + "\n"
        path = rezipped(package, tmp_path / f"{count}.zip", manifest__json=text.encode())
        count += 1
        assert outcome(path, small_list)[0] is not ExitStatus.CONFORMANT
    spaced = rezipped(package, path, manifest__json=f"{json.dumps(plain)}\n".encode())
    assert outcome(spaced, small_list)[0] is ExitStatus.NONCONFORMANT
    assert count > 3 * len(FILES)


@pytest.mark.parametrize("problem", ["removed", "added", "doubled", "altered"])
def test_each_changed_case_is_named(
    verify: Verify, package: Path, results: Results, tmp_path: Path, problem: str
) -> None:
    path = tmp_path / "changed.zip"
    for number, case in enumerate(results.cases):
        changed = {
            "removed": (),
            "added": (case, replace(case, id=f"{case.id}x")),
            "doubled": (case, case),
            "altered": (replace(case, message=f"{case.message}x"),),
        }[problem]
        cases = (*results.cases[:number], *changed, *results.cases[number + 1 :])
        text = replace(results, cases=cases).to_json()
        rezipped(package, path, results__json=text.encode())
        status, text = verify(path)
        assert status == 1
        named, word = changed[-1].id if changed else case.id, problem.replace("doubled", "altered")
        assert re.findall(r"case (\S+) was (\w+)", text) == [(named, word)]


# Hostile archives.


def _hostile(path: Path, package: Path, kind: str) -> None:
    rezipped(package, path)
    with zipfile.ZipFile(path, "a") as archive:
        if kind == "name":
            archive.writestr("../escaped", b"")
        elif kind == "absolute":
            archive.writestr("/tmp/escaped", b"")
        elif kind == "twice":
            archive.writestr("junit.xml", b"")
        elif kind == "comment":
            archive.comment = b"hidden"
        elif kind == "many":
            for number in range(2000):
                archive.writestr(f"{number}", b"")
    if kind == "before":
        path.write_bytes(b"#!/bin/sh\n" + path.read_bytes())


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("name", (1, "no package contains a file '../escaped'")),
        ("absolute", (1, "no package contains a file '/tmp/escaped'")),
        ("twice", (1, "it contains junit.xml 2 times")),
        ("many", (1, "its directory is too large")),
        ("comment", (2, "it is not a package")),
        ("before", (1, "there are other bytes before its first file")),
    ],
)
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_hostile_names(
    verify: Verify, package: Path, tmp_path: Path, kind: str, expected: tuple[int, str]
) -> None:
    path = tmp_path / "hostile.zip"
    _hostile(path, package, kind)
    status, text = verify(path)
    assert (status, text.count("\n")) == (expected[0], 1)
    assert expected[1] in text
    assert [file.name for file in tmp_path.iterdir()] == ["hostile.zip"]


@pytest.mark.parametrize("kind", ["link", "bomb", "method"])
def test_hostile_entries(verify: Verify, package: Path, tmp_path: Path, kind: str) -> None:
    """A symbolic link, a file of 100 MiB in 100 KiB, and an unknown compression are refused."""
    path = rezipped(package, tmp_path / "hostile.zip", ics__json=None)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        entry = zipfile.ZipInfo("ics.json")
        entry.compress_type = zipfile.ZIP_DEFLATED
        if kind == "link":
            entry.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(entry, bytes(100 * 2**20) if kind == "bomb" else b"/etc/passwd")
    if kind == "method":
        data = path.read_bytes()
        end = data.rindex(b"PK\1\2")
        path.write_bytes(data[: end + 10] + b"\x63\0" + data[end + 12 :])
    status, text = verify(path)
    says = {"link": "not a regular file", "bomb": "too large", "method": "compressed otherwise"}[
        kind
    ]
    assert (status, text.count("\n")) == (1, 1)
    assert says in text


@pytest.mark.parametrize("content", [None, b"", b"no archive", b"PK\5\6" + bytes(18)])
def test_no_package(verify: Verify, tmp_path: Path, content: bytes | None) -> None:
    """A missing file, or one that is no archive or an empty one."""
    path = tmp_path / "none.zip"
    if content is not None:
        path.write_bytes(content)
    status, text = verify(path)
    assert status == (1 if content and content.startswith(b"PK") else 2)
    assert text.startswith("scaraspec: ")
    assert text.count("\n") == 1


def test_nowhere_to_extract(
    verify: Verify, package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It cannot be decided. A folder in place of a package is a usage error."""
    monkeypatch.setattr("tempfile.tempdir", f"{tmp_path / 'none'}")
    status, text = verify(package)
    assert (status, "its files cannot be extracted: No such file" in text) == (3, True)
    status, text = verify(tmp_path)
    assert (status, text) == (2, f"scaraspec: {tmp_path}: it cannot be read: Is a directory\n")


def test_damaged(verify: Verify, package: Path, tmp_path: Path) -> None:
    path = tmp_path / "cut.zip"
    path.write_bytes(package.read_bytes()[:-100])
    assert verify(path)[0] == 2


# Signature.

needs_keys = pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="needs ssh-keygen")


@needs_keys
def test_signed(verify: Verify, copy: Path, key: Path, tmp_path: Path) -> None:
    """The public key, or a file of allowed signers, names the signer."""
    sign(copy, key)
    public = key.with_suffix(".pub")
    assert "verified, signature not checked: " in verify(copy)[1]
    status, text = verify(copy, "--signer", public)
    assert status == 0, text
    assert "verified, signed: " in text
    page = tmp_path / "page.html"
    verify(copy, "--signer", public, "--certificate", page)
    assert re.search(r"<bdi>ED25519 key SHA256:\S{43}</bdi>", page.read_text())
    allowed = tmp_path / "allowed_signers"
    allowed.write_text(f"li@lab.example {public.read_text()}")
    other_page = tmp_path / "other.html"
    assert verify(copy, "--signer", allowed, "--certificate", other_page)[0] == 0
    assert "<bdi>li@lab.example, ED25519 key SHA256:" in other_page.read_text()


@needs_keys
def test_the_documented_commands(
    verify: Verify, package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """docs/certificates.md shows how to sign; the new key gets no passphrase here."""
    page = (ROOT / "docs/certificates.md").read_text("utf-8")
    (block,) = (b for b in re.findall(r"```sh\n(.*?)```", page, re.DOTALL) if "-Y sign" in b)
    monkeypatch.chdir(tmp_path)
    shutil.copy(package, "plant-a.scaraspec.zip")
    create, sign_it, check = (shlex.split(line, comments=True) for line in block.splitlines())
    subprocess.run([*create, "-q", "-N", ""], check=True)
    subprocess.run(sign_it, check=True, capture_output=True)
    status, text = verify(*check[2:])
    assert status == 0, text
    assert "plant-a.scaraspec.zip: verified, signed: " in text


@needs_keys
def test_wrong_signature(verify: Verify, copy: Path, key: Path, tmp_path: Path) -> None:
    """A missing signature, that of another key, and that of another file are refused."""
    public = key.with_suffix(".pub")
    status, text = verify(copy, "--signer", public)
    assert (status, "the package is unsigned" in text) == (1, True)
    other = tmp_path / "other"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", other], check=True)
    sign(copy, other)
    status, text = verify(copy, "--signer", public)
    assert (status, "was not made by" in text) == (1, True)
    other.write_bytes(b"another file")
    signature = copy.with_name(f"{copy.name}.sig")
    signature.unlink()
    sign(other, key)
    shutil.move(other.with_name("other.sig"), signature)
    status, text = verify(copy, "--signer", public)
    assert (status, "is not a signature of this package" in text) == (1, True)


def test_no_signer(
    verify: Verify, copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A missing key file is a usage error; without ssh-keygen it cannot be decided."""
    copy.with_name(f"{copy.name}.sig").touch()
    status, text = verify(copy, "--signer", tmp_path / "none.pub")
    assert (status, "none.pub cannot be read" in text) == (2, True)
    public = tmp_path / "key.pub"
    public.write_text("ssh-ed25519 AAAA")
    monkeypatch.setenv("PATH", "")
    status, text = verify(copy, "--signer", public)
    assert (status, "ssh-keygen is not installed" in text) == (3, True)
