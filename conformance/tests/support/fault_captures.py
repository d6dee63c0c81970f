"""The captures of fixtures/captures/faults.toml; fault_captures.py FOLDER writes them as pcapng."""

import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

from traffic_notation import wire_events

from scaraspec_recorder.sinks.pcapng_writer import PcapngWriter

_TABLE = Path(__file__).parents[3] / "fixtures" / "captures" / "faults.toml"
_BEGIN_NS = 1_767_225_600_000_000_000  # 2026-01-01


def captures() -> list[dict[str, Any]]:
    """Return the entries of the table."""
    return list(tomllib.loads(_TABLE.read_text("utf-8"))["capture"])


def write(session: str, path: Path) -> None:
    """Write the traffic of a session as a packet capture."""
    with path.open("wb") as file:
        writer = PcapngWriter(file)
        for event in wire_events(session):
            writer.write(replace(event, time_ns=event.time_ns + _BEGIN_NS))


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for capture in captures():
        write(capture["session"], folder / f"{capture['name']}.pcapng")
