"""`scaraspec archive`: the tables of many captures, in a folder on this machine."""

import csv
import io
import json
import shutil
from collections import Counter
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from scaraspec.api.auditing import audit
from scaraspec.cli.main import group
from scaraspec.cli.problems import Problem
from scaraspec.judge.verdicts import ExitStatus, Verdict
from scaraspec.tables.archive.store import PartName, Source, Store
from scaraspec.tables.files import TableFolder
from scaraspec.tables.schema import FileRow

_FIELD = Path(__file__).parents[3] / "fixtures" / "captures" / "field"
_CAPTURES = {
    "line-1": ("plant-a-morning-shift.pcapng", "plant-a-torn.pcapng"),
    "line-2": ("complaint-1.pcapng", "complaint-2.pcapng"),
}


def run(*arguments: object) -> Result:
    return CliRunner().invoke(group, ["archive", *map(str, arguments)])


def rows(store: Path, sql: str) -> list[dict[str, str]]:
    done = run("query", store, sql, "--csv")
    assert done.exit_code == 0, done.output
    return list(csv.DictReader(io.StringIO(done.stdout)))


def build(captures: Path, store: Path, *arguments: object) -> Result:
    return run("build", captures, "--to", store, "--jobs", 1, *arguments)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Result]:
    """Captures of two robots, their archive, and what the build printed."""
    folder = tmp_path_factory.mktemp("archive")
    captures, store = folder / "captures", folder / "store"
    for robot, names in _CAPTURES.items():
        (captures / robot).mkdir(parents=True)
        for name in names:
            shutil.copy(_FIELD / name, captures / robot)
    torn = (_FIELD / "plant-a-morning-shift.pcapng").read_bytes()[:-1000]
    (captures / "line-1" / "torn.pcapng").write_bytes(torn)
    (captures / "line-2" / "corrupt.pcap").write_bytes(bytes(range(256)))
    (captures / "line-2" / "empty.mcap").touch()
    (captures / "line-2" / "notes.txt").write_text("not a capture")
    return captures, store, build(captures, store)


def test_a_build(built: tuple[Path, Path, Result]) -> None:
    """Unreadable captures are named; exit status 3."""
    _, _, done = built
    assert done.exit_code == 3, done.output
    assert done.stdout == (
        "7 captures: 0 unchanged, 2 inconclusive, 1 no-violation-found, 2 nonconformant, "
        "2 unreadable\n"
    )
    assert "corrupt.pcap is not a capture" in done.stderr
    assert "empty.mcap is empty" in done.stderr


def test_every_capture_has_a_row(built: tuple[Path, Path, Result]) -> None:
    """An unreadable capture has its reason, a torn one is not whole, and neither is conformant."""
    captures, store, _ = built
    found = {Path(row["file"]).name: row for row in rows(store, "FROM files")}
    assert {name: row["verdict"] for name, row in found.items()} == {
        "plant-a-morning-shift.pcapng": "no-violation-found",
        "plant-a-torn.pcapng": "inconclusive",
        "torn.pcapng": "inconclusive",
        "complaint-1.pcapng": "nonconformant",
        "complaint-2.pcapng": "nonconformant",
        "corrupt.pcap": "unreadable",
        "empty.mcap": "unreadable",
    }
    assert found["torn.pcapng"]["whole"] == "False"
    assert "later packets were not read" in found["torn.pcapng"]["notes"]
    assert found["corrupt.pcap"]["notes"].endswith("neither MCAP, pcap nor pcapng")
    assert found["complaint-1.pcapng"]["robot"] == "line-2"
    assert found["complaint-1.pcapng"]["day"] == "2026-11-20"
    assert found["complaint-1.pcapng"]["file"] == f"{captures / 'line-2' / 'complaint-1.pcapng'}"


def test_findings_are_those_of_audit(built: tuple[Path, Path, Result]) -> None:
    captures, store, _ = built
    for name in ("line-1/plant-a-torn.pcapng", "line-2/complaint-1.pcapng"):
        results, _ = audit(captures / name, port=8877)
        expected = {
            (case.requirements[0], case.verdict.value)
            for case in results.cases
            if case.verdict not in (Verdict.PASS, Verdict.NONE)
        }
        archived = rows(store, f"FROM findings WHERE file = '{captures / name}'")
        assert {(row["requirement"], row["verdict"]) for row in archived} == expected


def test_a_second_build_judges_only_what_has_changed(tmp_path: Path) -> None:
    """Rows of the earlier content are removed; those of a removed capture stay."""
    captures, store = tmp_path / "captures", tmp_path / "store"
    captures.mkdir()
    for name in ("complaint-1.pcapng", "complaint-2.pcapng"):
        shutil.copy(_FIELD / name, captures)
    assert build(captures, store).exit_code == 0
    exchanges = len(rows(store, "FROM exchanges"))
    assert build(captures, store).stdout == "2 captures: 2 unchanged\n"
    (captures / "complaint-2.pcapng").unlink()
    shutil.copy(_FIELD / "plant-a-morning-shift.pcapng", captures / "complaint-1.pcapng")
    assert build(captures, store).stdout == "1 capture: 0 unchanged, 1 no-violation-found\n"
    assert len(rows(store, "FROM files")) == 2
    names = {Path(row["file"]).name for row in rows(store, "FROM exchanges")}
    assert names == {"complaint-1.pcapng", "complaint-2.pcapng"}
    assert len(rows(store, "FROM exchanges")) != exchanges
    parts = [path for path in store.rglob("*") if path.is_file()]
    assert Counter(path.suffix for path in parts) == {".parquet": 12, ".json": 1}


def test_parts_of_a_killed_build_are_not_seen(tmp_path: Path) -> None:
    """The file in `files` is written last; the next build completes the rest."""
    captures, store = tmp_path / "captures", tmp_path / "store"
    captures.mkdir()
    for name in ("complaint-1.pcapng", "complaint-2.pcapng"):
        shutil.copy(_FIELD / name, captures)
    build(captures, store)
    before = rows(store, "FROM exchanges")
    (part,) = (path for path in store.glob("files/*/*/*") if "complaint-1" in path.name)
    part.unlink()
    assert {Path(row["file"]).name for row in rows(store, "FROM exchanges")} == {
        "complaint-2.pcapng"
    }
    assert build(captures, store).stdout == "2 captures: 1 unchanged, 1 nonconformant\n"
    assert sorted(map(str, rows(store, "FROM exchanges"))) == sorted(map(str, before))


@pytest.mark.parametrize(
    ("view", "columns"),
    [
        ("verdicts", "robot day verdict files failures"),
        ("requirements", "requirement side verdict message findings robots first last"),
        ("latency", "robot day command exchanges p50_ms p95_ms p99_ms max_ms"),
        ("firmware", "robot version first last"),
        ("readings", "robot reading side findings first last"),
        ("lost", "robot day losses bytes"),
    ],
)
def test_views(built: tuple[Path, Path, Result], view: str, columns: str) -> None:
    _, store, _ = built
    assert " ".join(rows(store, f"FROM {view}")[0]) == columns


def test_robots_that_refused_a_move(built: tuple[Path, Path, Result]) -> None:
    """The question of a fleet: who refused what, and since when."""
    _, store, _ = built
    refused = rows(
        store,
        "SELECT robot, code, min(time) AS first FROM exchanges WHERE command = 'reset' "
        "AND accepted = false AND time >= '2026-10-01' GROUP BY ALL ORDER BY ALL",
    )
    assert refused[0]["robot"] == "line-1"
    assert refused[0]["code"] == "01"
    assert refused[0]["first"].startswith("2026-11-20T22:58:")


def test_a_table_for_people(built: tuple[Path, Path, Result]) -> None:
    done = run("query", built[1], "SELECT robot, count(*) AS files FROM files GROUP BY ALL")
    assert [line.split() for line in sorted(done.stdout.splitlines())] == [
        ["line-1", "3"],
        ["line-2", "4"],
        ["robot", "files"],
    ]


def test_the_report(built: tuple[Path, Path, Result], tmp_path: Path) -> None:
    """Verdicts by day, findings with the command that shows them, latency; both languages."""
    captures, store, _ = built
    page = tmp_path / "archive.html"
    assert run("report", store, "--out", page, "--since", "2026-11-20").exit_code == 0
    text = page.read_text("utf-8")
    assert "New kinds of findings since 2026-11-20" in text
    assert "2026-11-20 以来新出现的判定种类" in text
    assert f"scaraspec view {captures}/line-2/complaint-2.pcapng --at 2026-11-20T22:58:58" in text
    assert "corrupt.pcap is not a capture" in text
    assert "://" not in text
    assert run("report", store, "--out", page, "--since", "2026-11-21").exit_code == 0
    assert "Earlier findings" in page.read_text("utf-8")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("query", "{store}", "SELEC 1"), 'Parser Error: syntax error at or near "SELEC"'),
        (("query", "{folder}", "FROM files"), "is no archive: scaraspec archive build makes one"),
        (("build", "{folder}/nothing", "--to", "{folder}/new"), "nothing has no capture"),
        (("build", "{folder}", "--to", "{folder}"), "has other files: name a new folder"),
        (("build", "{folder}", "--to", "nofs://x"), "Protocol not known: nofs"),
        (("report", "{store}", "--out", "{folder}/a.pcapng"), "is no earlier report"),
    ],
)
def test_user_errors(
    built: tuple[Path, Path, Result], tmp_path: Path, arguments: tuple[str, ...], sentence: str
) -> None:
    """One sentence, exit status 2, and nothing is changed."""
    shutil.copy(_FIELD / "complaint-1.pcapng", tmp_path / "a.pcapng")
    names = {"store": built[1], "folder": tmp_path}
    done = run(*(each.format(**names) for each in arguments))
    assert isinstance(done.exception, Problem)
    assert done.exception.exit_status is ExitStatus.USAGE
    assert sentence in str(done.exception)
    assert [path.name for path in tmp_path.iterdir()] == ["a.pcapng"]


def test_hostile_names(tmp_path: Path) -> None:
    """Names of robots and files cannot leave the store, nor the SQL of a view."""
    store = Store(str(tmp_path / "it's"), create=True)
    file = FileRow(
        file="x", begun_ns=None, ended_ns=None, whole=True, notes="", verdict="conformant"
    )
    tables = TableFolder(
        tmp_path / "tables",
        "parquet",
        ("files", "sessions", "exchanges", "transfers", "findings", "losses"),
    )
    tables.add(file)
    tables.close()
    source = Source("/captures/../..\\'; DROP TABLE files.pcap", 1, "1")
    store.put(PartName(source, "0" * 16, "../../etc"), file, tmp_path / "tables")
    assert rows(Path(store.url), "SELECT robot, day, verdict FROM files") == [
        {"robot": "../../etc", "day": "", "verdict": "conformant"}
    ]
    assert {path.name for path in tmp_path.iterdir()} == {"it's", "tables"}
    assert json.loads((tmp_path / "it's" / "scaraspec-archive.json").read_text())
