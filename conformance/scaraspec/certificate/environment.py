"""Environment of a certification: who tested which sample, where, and with what."""

import platform
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from scaraspec.report.model import Results
from scaraspec.suite.engine.ics import LABORATORY, SAMPLE, Ics
from scaraspec.user_message import UserMessage
from scaraspec.version import commit

_TIMEOUT_S: Final = 10
_MACHINE: Final = ("host", "operating_system", "python", "clock")
_ROUND_TRIP: Final = "get_status"


@dataclass(frozen=True, slots=True)
class StatedEnvironment:
    """The environment that a package states, except the round trip, which is in the results."""

    sample: Mapping[str, str]
    laboratory: Mapping[str, str]
    machine: Mapping[str, str]
    tool: Mapping[str, str]

    def problems(self, ics: Mapping[str, object], results: Results) -> Iterator[str]:
        """Yield what is missing, or is different in the ICS or in the results of the package."""
        for table, keys, values in (
            ("sample", SAMPLE, self.sample),
            ("laboratory", LABORATORY, self.laboratory),
            ("machine", _MACHINE, self.machine),
        ):
            for key in keys:
                if not values.get(key):
                    yield UserMessage("{table}.{key} is missing", table=table, key=key)
        for table, values in (("sample", self.sample), ("laboratory", self.laboratory)):
            if values != ics.get(table):
                yield UserMessage("ics.json has another {table}", table=table)
        stated = (self.tool.get("version"), self.machine.get("python"))
        if stated != (results.tool.version, results.run.python if results.run else None):
            yield "results.json has another version of scaraspec or Python"


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
            "host": platform.node() or "unknown",
            "operating_system": platform.platform(),
            "python": platform.python_version(),
            "clock": _clock(),
        },
        "tool": {"version": results.tool.version, "commit": commit()},
        "round_trip": round_trip(results),
    }


def round_trip(results: Results) -> dict[str, object]:
    """Return the measured time from a status request to its reply; empty if there is none."""
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
