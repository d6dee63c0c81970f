"""Environment of a certification: who tested which sample, where, and with what."""

import platform
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import scaraspec
from scaraspec.report.model import Results, Tool
from scaraspec.suite.engine.ics import LABORATORY, SAMPLE, Ics
from scaraspec.user_message import UserMessage

_TIMEOUT_S: Final = 10
_FOLDER: Final = Path(scaraspec.__file__).parent
_ROUND_TRIP: Final = "get_status"


@dataclass(frozen=True, slots=True)
class StatedEnvironment:
    """The part of the environment that a certificate shows."""

    sample: Mapping[str, str]
    laboratory: Mapping[str, str]
    tool: Mapping[str, str]

    def problems(self, ics: Mapping[str, object]) -> Iterator[str]:
        """Yield what is missing, or is different in the ICS of the package."""
        for table, keys, values in (
            ("sample", SAMPLE, self.sample),
            ("laboratory", LABORATORY, self.laboratory),
        ):
            for key in keys:
                if not values.get(key):
                    yield UserMessage("{table}.{key} is missing", table=table, key=key)
            if values != ics.get(table):
                yield UserMessage("ics.json has another {table}", table=table)


def environment(ics: Ics, results: Results) -> dict[str, Mapping[str, object]]:
    """Return the environment as plain values.

    Args:
        ics: The ICS with the sample and the laboratory.
        results: The results of the run, which contain the measured round trips.
    """
    return {
        "laboratory": ics.laboratory,
        "sample": ics.sample,
        "machine": {
            "host": platform.node(),
            "operating_system": platform.platform(),
            "python": platform.python_version(),
            "clock": _clock(),
        },
        "tool": {"version": Tool.own().version, "commit": _commit()},
        "round_trip": _round_trip(results),
    }


def _round_trip(results: Results) -> dict[str, object]:
    """Return the measured time from a status request to its reply."""
    for each in results.session.exchanges if results.session else ():
        if each.name == _ROUND_TRIP and (times := each.latency):
            return {
                "command": each.name,
                "count": times.count,
                "min_ms": times.min_ms,
                "p50_ms": times.p50_ms,
                "p99_ms": times.p99_ms,
            }
    return {}


def _clock() -> str:
    """Return whether the system clock is synchronized; "unknown" if the system does not say."""
    answer = _output("timedatectl", "show", "--property=NTPSynchronized", "--value")
    return {"yes": "synchronized", "no": "not synchronized"}.get(answer, "unknown")


def _commit() -> str:
    """Return the commit of this tool; empty if it is installed without its repository."""
    if not _output("git", "-C", f"{_FOLDER}", "ls-files", "__init__.py"):
        return ""  # the folder is inside of another repository, or of none
    commit = _output("git", "-C", f"{_FOLDER}", "rev-parse", "HEAD")
    changed = _output("git", "-C", f"{_FOLDER}", "status", "--porcelain", "--untracked-files=no")
    return f"{commit}, with changes" if changed else commit


def _output(program: str, *arguments: str) -> str:
    """Return the output of a program; empty if it is missing or fails."""
    path = shutil.which(program)
    if path is None:
        return ""
    try:
        ran = subprocess.run(  # noqa: S603 - a program of the system, with fixed arguments
            [path, *arguments], capture_output=True, text=True, timeout=_TIMEOUT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return ran.stdout.strip() if ran.returncode == 0 else ""
