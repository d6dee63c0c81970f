"""`scaraspec verify`: each exit status, and each thing that a package may have wrong."""

import hashlib
import json
import re
import shlex
import shutil
import stat
import subprocess
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from certification import (
    CASES,
    ICS,
    STATUS,
    Verify,
    calibrated,
    certification_of,
    certified,
    list_of_cases,
    packed,
)
from wording import ROOT

from scaraspec.api import audit
from scaraspec.api.certificates import PackageError, verify_package, write_package
from scaraspec.certificate import checks
from scaraspec.certificate.mandatory import MandatoryList
from scaraspec.certificate.package import FILES, MANIFEST, plain_json
from scaraspec.judge.verdicts import Cause, Conclusion, ExitStatus, Reason, Verdict, conclude
from scaraspec.mutants.controller import mutants
from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame
from scaraspec.report import junit
from scaraspec.report.model import SEEN, Case, Results, Role, Session, Tool
from scaraspec.suite.engine.hooks import CommandHook
from scaraspec.virtual_controller.core import ControllerCore

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


def rezipped(package: Path, path: Path, **changes: bytes | None) -> Path:
    """Write a package with other files; None leaves one out. ``__`` in a name is a dot."""
    texts = {name.replace("__", "."): data for name, data in changes.items()}
    with zipfile.ZipFile(package) as source, zipfile.ZipFile(path, "w") as target:
        files: dict[str, bytes | None] = {name: source.read(name) for name in source.namelist()}
        for name, data in {**files, **texts}.items():
            if data is not None:
                target.writestr(name, data)
    return path


def outcome(path: Path, mandatory: MandatoryList) -> tuple[ExitStatus, tuple[str, ...]]:
    """Return the exit status for a package, and the problems."""
    try:
        verification = verify_package(path, lists=[mandatory])
    except PackageError as error:
        return error.exit_status, (f"{error}",)
    return verification.exit_status, tuple(p for each in verification.checks for p in each.problems)


def concluded(results: Results, *cases: Case) -> Results:
    """Return results with other cases, and all verdicts that follow from them."""
    by_id = {case.id: case.verdict for case in cases}
    requirements = tuple(
        replace(
            each,
            verdict=max(
                (by_id[i] for i in each.cases if i in by_id),
                key=list(Verdict).index,
                default=Verdict.NONE,
            ),
            cases=tuple(i for i in each.cases if i in by_id),
        )
        for each in results.requirements
    )
    counts = dict.fromkeys(Verdict, 0) | Counter(case.verdict for case in cases)
    verdict = conclude(counts, complete=all(each.decided for each in requirements))
    return replace(
        results, cases=cases, requirements=requirements, counts=counts, verdict=verdict, causes=()
    )


def with_settings(results: Results, seed: int = 0, **settings: str) -> Results:
    """Return results with other settings of the run."""
    assert results.run
    changed = {**results.run.settings, **settings}
    return replace(results, run=replace(results.run, seed=seed, settings=changed))


@pytest.fixture
def results(run_folder: Path) -> Results:
    """Return the results of the conformant certification."""
    return Results.read(run_folder / "results.json")


@pytest.fixture
def forge(run_folder: Path, small_list: MandatoryList, tmp_path: Path) -> Callable[[Results], Path]:
    """Make a package of changed results and the capture of the conformant certification."""
    capture = run_folder / "capture.mcap"
    return lambda results: packed(tmp_path / "forged", results, capture, small_list)


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
    found: Any = _plain(package, "environment.json")
    assert found["sample"] == {"serial_number": "7", "firmware": "1.4", "hardware": "B"}
    assert found["laboratory"] == {"name": "Lab", "operator": "Li"}
    machine = {"host", "operating_system", "python", "clock"}
    assert {key for key, text in found["machine"].items() if text} == machine
    assert found["tool"]["version"] == Tool.own().version
    assert found["round_trip"]["command"] == "get_status"
    assert found["round_trip"]["count"] > 0


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
    text = json.dumps({**_plain(package, "environment.json"), **changes}).encode()
    manifest: Any = _plain(package, MANIFEST)
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
    assert _plain(path, "ics.json")["claims"] == {"hooks.restart": "given"}
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


def _plain(package: Path, name: str) -> dict[str, object]:
    with zipfile.ZipFile(package) as archive:
        plain: dict[str, object] = json.loads(archive.read(name))
    return plain


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
    plain = _plain(package, MANIFEST)
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


# Version.


def test_unknown_list(verify: Verify, package: Path) -> None:
    status, text = verify(package, lists=())
    assert status == 3
    assert "this version does not know the list controller-2026-01-01 of scaraspec 0.2.0" in text
    assert text.endswith(": it cannot be decided\n")


def test_altered_list(verify: Verify, package: Path, small_list: MandatoryList) -> None:
    status, text = verify(package, lists=(replace(small_list, optional_hooks=()),))
    assert status == 1
    assert "the list controller-2026-01-01 has another checksum" in text


@pytest.mark.parametrize("tool", [Tool("scaraspec", "0.1.9"), Tool("other", Tool.own().version)])
def test_another_tool(
    verify: Verify, results: Results, forge: Callable[[Results], Path], tool: Tool
) -> None:
    """The list names the version, so that no other one can be pretended."""
    status, text = verify(forge(replace(results, tool=tool)))
    assert status == 1
    assert f"is no list of {tool.name} {tool.version} for a controller" in text


def test_later_format(verify: Verify, package: Path, tmp_path: Path) -> None:
    text = json.dumps({**_plain(package, MANIFEST), "schema": "scaraspec.package/9"})
    path = rezipped(package, tmp_path / "later.zip", manifest__json=text.encode())
    status, text = verify(path)
    assert (status, "use the version that made the package" in text) == (3, True)


def test_another_version(
    verify: Verify, results: Results, run_folder: Path, small_list: MandatoryList, tmp_path: Path
) -> None:
    """What another version judges differently is reported and not refused."""
    other = replace(small_list, version="0.1.9")
    seen = Case("4.8/1.seen-1", ("4.8/1",), Verdict.TOLERATED)
    changed = concluded(results, *results.cases, seen)
    changed = with_settings(changed, certification=other.title)
    changed = replace(changed, tool=Tool("scaraspec", "0.1.9"))
    path = packed(tmp_path / "other", changed, run_folder / "capture.mcap", other)
    status, text = verify(path, lists=(other,))
    assert status == 0, text
    assert "capture     ok  differs, but scaraspec 0.1.9 judged it" in text
    assert "the results have a finding on the wire about 4.8/1" in text


# Results that were changed together with the manifest.


@pytest.mark.parametrize("case_id", CASES)
@pytest.mark.parametrize("count", [0, 2])
def test_each_mandatory_case_once(
    verify: Verify, results: Results, forge: Callable[[Results], Path], case_id: str, count: int
) -> None:
    says = f"occurs {count} times" if count else "is missing"
    cases = [each for each in results.cases for _ in range(count if each.id == case_id else 1)]
    status, text = verify(forge(concluded(results, *cases)))
    assert status == 1
    assert f"case {case_id} {says}" in text


@pytest.mark.parametrize(
    ("reason", "message"),
    [
        (Reason.HAZARD, "it has a hazard that is not allowed"),
        (Reason.NOT_APPLICABLE, "the robot is not idle"),
        (Reason.SLOW, "it is slow"),
    ],
)
def test_skipped_case(
    verify: Verify,
    results: Results,
    forge: Callable[[Results], Path],
    reason: Reason,
    message: str,
) -> None:
    skipped = [
        replace(case, verdict=Verdict.NONE, reason=reason, message=message, cause=Cause.SET_UP)
        if case.id == STATUS
        else case
        for case in results.cases
    ]
    status, text = verify(forge(concluded(results, *skipped)))
    assert status == 1
    assert f"case {STATUS} was skipped without a reason that the list allows: {message}" in text


def test_required_hook(
    verify: Verify,
    results: Results,
    run_folder: Path,
    small_list: MandatoryList,
    tmp_path: Path,
) -> None:
    """A case is skipped for want of a hook: the list decides whether it may be."""
    strict = replace(small_list, optional_hooks=("clear_faults",))
    changed = with_settings(results, certification=strict.title)
    path = packed(tmp_path / "forged", changed, run_folder / "capture.mcap", strict)
    status, text = verify(path, lists=(strict,))
    assert status == 1
    assert "case 4/3.fault was skipped" in text


class WithoutClockQuery(ControllerCore):
    """Does not know the opcode of get_time."""

    def _command(self, frame: Frame) -> Command | None:
        command = super()._command(frame)
        return None if command and command.name == "get_time" else command


def test_unsupported_command(verify: Verify, tmp_path: Path) -> None:
    """The cases of a command may be skipped if the ICS claims so, and if the run has tried it."""
    clock = "4.5/4"
    mandatory = list_of_cases((clock, STATUS))
    ics = replace(ICS, unsupported=frozenset({"get_time"}))
    results = certified(tmp_path, mandatory, WithoutClockQuery, ics)
    path = tmp_path / "package.zip"
    write_package(certification_of(path, mandatory), tmp_path, ics)
    status, text = verify(path, lists=(mandatory,))
    assert status == 0, text
    assert "no violation found (3 of 5 requirements judged), without get_time" in text
    assert results.session
    others = tuple(each for each in results.session.exchanges if each.name != "get_time")
    for changed in (
        replace(results, subject=replace(results.subject, claims={})),
        replace(results, session=replace(results.session, exchanges=others)),
    ):
        found = [*checks.case_problems(changed, mandatory)]
        assert [f"case {clock} was skipped" in problem for problem in found] == [True]


def test_a_refuted_claim(tmp_path: Path) -> None:
    """The capture shows that a command is answered which the ICS calls unsupported."""
    mandatory = list_of_cases((STATUS,))
    ics = replace(ICS, unsupported=frozenset({"get_time"}))
    results = certified(tmp_path, mandatory, ics=ics)
    derived, _ = audit(tmp_path / "capture.mcap")
    assert [*checks.capture_problems(results, derived)] == []
    others = [case for case in results.cases if case.id != "claim.lacks.get_time"]
    assert [*checks.capture_problems(concluded(results, *others), derived)] == [
        "the capture has a failure claim.lacks.get_time, but the results have not"
    ]


def test_another_reading(verify: Verify, tmp_path: Path) -> None:
    """The list names the claims under which no case can judge a requirement."""
    order, claim = "3/24", "readings.pipelining=one"
    mandatory = replace(list_of_cases((order, STATUS)), unless_claimed={order: (claim,)})
    ics = ICS.with_claims(pipelining="one")
    results = certified(tmp_path, mandatory, ics=ics)
    path = tmp_path / "package.zip"
    write_package(certification_of(path, mandatory), tmp_path, ics)
    status, text = verify(path, lists=(mandatory,))
    assert status == 0, text
    unclaimed = replace(results, subject=replace(results.subject, claims={}))
    for found in (
        checks.case_problems(unclaimed, mandatory),
        checks.case_problems(results, replace(mandatory, unless_claimed={})),
    ):
        assert [f"case {order} was skipped" in problem for problem in found] == [True]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("only", "4.8"), ("exhaustive", "false"), ("fail_fast", "true"), ("examples", "1")),
        *(("allow", "state"), ("certification", ""), ("patience_s", "0")),
    ],
)
def test_other_options(
    verify: Verify, results: Results, forge: Callable[[Results], Path], name: str, value: str
) -> None:
    status, text = verify(forge(with_settings(results, seed=0, **{name: value})))
    assert status == 1
    assert f'option {name} is "{value}"' in text


@pytest.mark.parametrize("name", ["reply_timeout_s", "time_scale", "undefined_opcodes"])
def test_missing_and_unknown_options(
    verify: Verify, results: Results, forge: Callable[[Results], Path], name: str
) -> None:
    """An option that the laboratory chooses is stated, and no other one exists."""
    assert results.run
    settings = {key: value for key, value in results.run.settings.items() if key != name}
    changed = replace(results, run=replace(results.run, settings={**settings, "skip\n": "4"}))
    status, text = verify(forge(changed))
    assert status == 1
    assert f"option {name} is missing" in text
    assert "option 'skip\\n' is not known" in text


def test_other_seed(verify: Verify, results: Results, forge: Callable[[Results], Path]) -> None:
    status, text = verify(forge(with_settings(results, seed=77)))
    assert (status, "the seed is not one of 0 to 9" in text) == (1, True)


def test_verdicts(verify: Verify, results: Results, forge: Callable[[Results], Path]) -> None:
    """Counts, requirements and conclusion must follow from the cases."""
    first = results.requirements[0]
    other = Verdict.TOLERATED if first.verdict is Verdict.PASS else Verdict.PASS
    changed = replace(
        results,
        verdict=Conclusion.CONFORMANT,
        counts={**results.counts, Verdict.PASS: 99},
        requirements=(replace(first, verdict=other, cases=()), *results.requirements[2:]),
    )
    status, text = verify(forge(changed))
    assert status == 1
    assert (
        f"requirement {first.id} is {other.value}, but its cases are {first.verdict.value}" in text
    )
    assert f"requirement {results.requirements[1].id} is missing" in text
    assert f"requirement {first.id} names other cases" in text
    assert "the numbers of verdicts are not those of the cases" in text
    assert "the verdict is conformant, but the cases are" in text


def test_other_reports(
    verify: Verify,
    run_folder: Path,
    small_list: MandatoryList,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A report that does not show the results is refused."""
    monkeypatch.setattr(junit, "render", lambda _: "<testsuite/>")
    path = tmp_path / "forged.zip"
    write_package(certification_of(path, small_list), run_folder, replace(ICS, version="9"))
    monkeypatch.undo()
    status, text = verify(path)
    assert status == 1
    assert "junit.xml is not that of the results" in text
    assert "ics.json has other claims than the results" in text


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"reference": Conclusion.NONCONFORMANT}, "the reference implementation is nonconformant"),
        ({"mutants": {**calibrated().mutants, "status-in-words": ()}}, "no case kills status-in-"),
        ({"mutants": {}}, "has not tried the mutants that the seed chooses"),
        ({"seed": 1}, "the calibration has another role or seed than the run"),
        ({"role": Role.CLIENT}, "the calibration has another role or seed than the run"),
    ],
)
def test_other_calibration(
    verify: Verify,
    run_folder: Path,
    tmp_path: Path,
    change: dict[str, Any],
    says: str,
) -> None:
    path = tmp_path / "forged.zip"
    right = certification_of(path, list_of_cases())
    write_package(replace(right, calibration=replace(calibrated(), **change)), run_folder, ICS)
    status, text = verify(path)
    assert (status, says in text) == (1, True), text


def test_no_calibration(verify: Verify, run_folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "forged.zip"
    write_package(
        replace(certification_of(path, list_of_cases()), calibration=None), run_folder, ICS
    )
    status, text = verify(path)
    assert (status, "calibration.json is damaged" in text) == (1, True), text


# A controller that violates the protocol.


@pytest.fixture(scope="session")
def faulty(tmp_path_factory: pytest.TempPathFactory, small_list: MandatoryList) -> Path:
    """Return the folder of a certification of a controller whose status has one digit."""
    folder = tmp_path_factory.mktemp("faulty")
    certified(folder, small_list, mutants()["status-of-one-digit"].wrong)
    return folder


def test_nonconformant(
    verify: Verify, faulty: Path, small_list: MandatoryList, tmp_path: Path
) -> None:
    """A genuine package of a nonconformant controller does not verify as conformant."""
    path = tmp_path / "faulty.scaraspec.zip"
    write_package(certification_of(path, small_list), faulty, ICS)
    status, text = verify(path)
    assert status == 1
    assert "conclusion  FAILED\n  the controller is nonconformant: " in text
    assert text.endswith("verified, unsigned: Cell 7 1.4: nonconformant\n")
    assert "REFUSED" not in text


def test_the_capture_contradicts(
    verify: Verify, faulty: Path, results: Results, small_list: MandatoryList, tmp_path: Path
) -> None:
    """Failures removed from the results, and a recomputed manifest: the capture has them."""
    found = Results.read(faulty / "results.json")
    good = [
        replace(case, verdict=Verdict.PASS, cause=None, message="", wire=(), reason=None)
        for case in found.cases
        if SEEN not in case.id
    ]
    path = packed(tmp_path / "forged", concluded(found, *good), faulty / "capture.mcap", small_list)
    status, text = verify(path)
    assert status == 1
    assert "the capture violates 4.8/2, but the results do not say so" in text
    path = packed(tmp_path / "other", results, faulty / "capture.mcap", small_list)
    status, text = verify(path)
    assert status == 1
    assert "the traffic in the results is not that of the capture" in text


def _other_traffic(results: Results) -> Iterator[Session]:
    """Yield the traffic of results, each time with another member that differs."""
    assert results.session
    session = results.session
    for name in ("begun_ns", "ended_ns", "frames", "undecodable_bytes"):
        yield replace(session, **{name: getattr(session, name) + 1})
    for name in ("connections", "exchanges"):
        assert getattr(session, name)
        yield replace(session, **{name: getattr(session, name)[1:]})


def test_each_change_of_the_traffic(results: Results, run_folder: Path) -> None:
    derived, _ = audit(run_folder / "capture.mcap")
    assert [*checks.capture_problems(results, derived)] == []
    for session in _other_traffic(results):
        found = [*checks.capture_problems(replace(results, session=session), derived)]
        assert found == ["the traffic in the results is not that of the capture"]


def test_the_time_of_the_run(results: Results, run_folder: Path) -> None:
    """The dates of a certificate are those of the run, which contains the capture."""
    derived, _ = audit(run_folder / "capture.mcap")
    assert results.run
    year_ns = 365 * 86400 * 10**9
    for years in (-1, 1):
        moved = replace(
            results.run,
            begun_ns=results.run.begun_ns + years * year_ns,
            ended_ns=results.run.ended_ns + years * year_ns,
        )
        found = [*checks.capture_problems(replace(results, run=moved), derived)]
        assert found == ["the capture is of another time than the run"]


def test_inconclusive(verify: Verify, results: Results, forge: Callable[[Results], Path]) -> None:
    """Without a violation and without a verdict it cannot be decided."""
    left = Case("run.restore", (), Verdict.INCONCLUSIVE, message="a file is left")
    status, text = verify(forge(concluded(results, *results.cases, left)))
    assert status == 3, text
    assert "the controller is inconclusive" in text


def test_the_cases_of_the_small_list(small_list: MandatoryList) -> None:
    assert set(small_list.cases) == set(CASES)
