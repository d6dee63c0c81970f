"""Cost of `audit`: processor time per frame, relative to tshark and to another version.

`--against REVISION` compares with this revision of the repository, in neighbouring runs. It also
audits a corpus with both versions and compares their results byte for byte: the captures of
fixtures/captures, their difficult and incomplete variants, and generated polling. The exit status
is 1 if a result differs.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from bench.captures import PER_SECOND, write_changing, write_polling
from bench.stage import spread

_ROOT: Final = Path(__file__).parents[1]
_SUPPORT: Final = _ROOT / "conformance" / "tests" / "support"
_AUDIT: Final = """
import sys
from pathlib import Path
from scaraspec.api import audit
for path in sys.argv[1:]:
    try:
        text = audit(Path(path), port=8877)[0].to_json()
    except Exception as error:
        text = f"{error}"
    print(text.replace("\\n", ""), flush=True)
"""
_DAY_S: Final = 86_400
_QUIET: Final[dict[str, Any]] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
_FIELDS: Final = ("frame.number", "frame.time_epoch", "ip.src", "tcp.srcport", "tcp.payload")


def main() -> None:
    """Print the ratios, and whether the results are equal."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=200_000, help="frames of each capture")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--against", metavar="REVISION", help="another version")
    chosen = parser.parse_args()
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        files = {"polling": folder / "polling.pcapng", "changing": folder / "changing.pcapng"}
        write_polling(files["polling"], chosen.frames // 2)
        write_changing(files["changing"], chosen.frames // 2)
        other = _checked_out(chosen.against, folder / "other") if chosen.against else None
        for name, file in files.items():
            _measure(name, file, other, chosen.rounds)
        _measure_day(folder, chosen.frames // 2, chosen.rounds)
        differing = _compare(folder, other) if other else 0
    if differing:
        raise SystemExit(1)


def _measure(name: str, file: Path, other: Path | None, rounds: int) -> None:
    shark = shutil.which("tshark")
    ratios: dict[str, list[float]] = {"tshark -T fields": [], "the other version": []}
    memory_mib = 0.0
    for _ in range(rounds):
        own_s, memory_mib = _timed(_python(file), _environment(_ROOT))
        if shark:
            fields = [part for field in _FIELDS for part in ("-e", field)]
            shark_s, _ = _timed([shark, "-r", f"{file}", "-T", "fields", *fields], {**os.environ})
            ratios["tshark -T fields"].append(own_s / shark_s)
        if other:
            other_s, _ = _timed(_python(file), _environment(other))
            ratios["the other version"].append(own_s / other_s)
    print(f"processor time of audit, {name} values; peak memory {memory_mib:.0f} MiB:")
    for peer, values in ratios.items():
        if values:
            print(f"  relative to {peer}: {spread(values)}")


def _measure_day(folder: Path, exchanges: int, rounds: int) -> None:
    """Print how long two processes need for a day of recordings of a robot, from shorter ones."""
    walls_s: dict[int, list[float]] = {}
    for size in (100, exchanges):
        source, *files = (folder / name for name in ("day.pcapng", "1.mcap", "2.mcap"))
        write_polling(source, size)
        scaraspec = [sys.executable, "-m", "scaraspec"]
        subprocess.run([*scaraspec, "convert", source, files[0]], check=True, **_QUIET)  # noqa: S603 - ourselves
        shutil.copy(files[0], files[1])
        for _ in range(rounds):
            begun_s = time.monotonic()
            subprocess.run([*scaraspec, "audit", *files, "--jobs", "2"], check=False, **_QUIET)  # noqa: S603 - ourselves
            walls_s.setdefault(size, []).append(time.monotonic() - begun_s)
        files[0].unlink()
    start_s = min(walls_s[100])
    day_s = [(s - start_s) / (2 * exchanges) * PER_SECOND * _DAY_S for s in walls_s[exchanges]]
    minutes = spread([each_s / 60 for each_s in day_s])
    print(f"a day of one robot in hourly recordings, two processes: {minutes} min")


def _python(*files: Path) -> list[str]:
    return [sys.executable, "-c", _AUDIT, *map(str, files)]


def _environment(root: Path) -> dict[str, str]:
    sources = (root / "conformance", root / "recorder", _SUPPORT)
    return {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, sources))}


def _timed(command: list[str], environment: dict[str, str]) -> tuple[float, float]:
    """Run a command; return its processor time in seconds and its peak memory in MiB."""
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)  # noqa: S603 - ourselves
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, command
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def _checked_out(revision: str, folder: Path) -> Path:
    """Return a folder with another revision of the repository."""
    folder.mkdir()
    archive = folder / "archive.tar"
    git = ("git", "-C", f"{_ROOT}", "archive", "-o", f"{archive}", revision)
    subprocess.run([*git, "conformance/scaraspec", "recorder/scaraspec_recorder"], check=True)  # noqa: S603 - a revision of ourselves
    shutil.unpack_archive(archive, folder, filter="data")
    return folder


def _compare(folder: Path, other: Path) -> int:
    """Audit the corpus with both versions; print and count the captures that differ."""
    corpus = folder / "corpus"
    for script in ("difficult_captures", "fault_captures"):
        make = [sys.executable, "-m", script, f"{corpus / script}"]
        subprocess.run(make, env=_environment(_ROOT), check=True)  # noqa: S603 - ourselves
    write_polling(folder / "polling.pcapng", 10_000)
    write_changing(folder / "changing.pcapng", 10_000)
    fixtures = _ROOT / "fixtures" / "captures"
    files = [
        *sorted(path for path in fixtures.rglob("*.*cap*")),
        *sorted(path for path in corpus.rglob("*.pcap*")),
        *(folder / f"{name}.pcapng" for name in ("polling", "changing")),
    ]
    results = []
    for root in (_ROOT, other):
        done = subprocess.run(  # noqa: S603 - ourselves
            _python(*files), env=_environment(root), stdout=subprocess.PIPE, text=True, check=True
        )
        results.append(done.stdout.splitlines())
    differing = 0
    for file, ours, theirs in zip(files, *results, strict=True):
        if ours != theirs:
            differing += 1
            print(f"{file.name} differs: {', '.join(_differing_keys(ours, theirs))}")
    print(f"{len(files)} captures compared, {differing} results differ")
    return differing


def _differing_keys(one: str, other: str) -> list[str]:
    try:
        a, b = json.loads(one), json.loads(other)
    except json.JSONDecodeError:
        return ["an error"]
    return [key for key in a if a[key] != b.get(key)]


if __name__ == "__main__":
    main()
