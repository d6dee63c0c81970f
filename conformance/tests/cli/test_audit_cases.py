"""`scaraspec audit` of the captures in `fixtures/captures/cases`, each with one situation."""

from pathlib import Path
from typing import Any

import pytest


@pytest.mark.parametrize(
    ("name", "options", "exit_status", "message"),
    [
        ("reply-then-reset.pcap", "", 0, "no violation found"),
        ("two-packets-swapped.pcap", "", 0, "no violation found"),
        ("in-pppoe.pcap", "", 0, "no violation found (238 of"),
        ("in-vxlan.pcap", "", 0, "no violation found (238 of"),
        ("in-llc-snap.pcap", "", 0, "no violation found (238 of"),
        ("in-hsr.pcap", "", 0, "no violation found (238 of"),
        ("modbus-only.pcap", "--port 0", 4, "is not of this protocol (port 502): not judged"),
        ("modbus-only.pcap", "", 4, "1 connection is not of this protocol (port 502): not judged"),
        ("tls-only.pcap", "--port 0", 4, "1 connection is not of this protocol (port 443): not"),
        ("modified-pcap.cap", "", 2, "is a modified pcap file: convert it with editcap"),
        ("lz4-compressed.mcap", "", 1, "fail · 3/18"),
        ("sequence-always-zero.mcap", "", 0, "no violation found"),
        ("dst.pcap", "", 0, "tolerated · 4.6/4 · the clock changed by one hour"),
        ("interleaved.pcap", "", 1, "the bytes of get_status and run_program are mixed"),
        ("two-recordings-merged.mcap", "", 2, "audit each recording by itself"),
        (
            "late-thread.pcap",
            "",
            3,
            "inconclusive · 3/31 · get_digital_outputs was answered after 6.0",
        ),
        ("late-run.pcap", "", 3, "the client may have taken the reply to the first request"),
        ("settle.pcap", "", 0, "run_program, for 3 ms to 74 ms (observed status_lag"),
        ("runagain.pcap", "", 3, "inconclusive · 4/16"),
        ("gbk.pcap", "", 1, "程序.rob was uploaded in UTF-8 but is listed in GBK"),
        ("runday.pcap", "", 1, "fail · 4.9/5"),
        ("stopchunk.pcap", "", 1, "fail · 5.2/12"),
        ("case.pcap", "", 1, "PRO1.ROB was deleted: the names differ only in case"),
        ("one-flipped-bit.mcap", "", 3, "the length of 1 records was wrong"),
    ],
)
def test_a_case(  # noqa: PLR0913, PLR0917 - two fixtures and a row of the table
    processes: Any, fixtures_dir: Path, name: str, options: str, exit_status: int, message: str
) -> None:
    """The exit status and the main sentence match the situation."""
    file = fixtures_dir / "captures" / "cases" / name
    done = processes.run("audit", f"{file}", *options.split())
    output = done.stdout + done.stderr
    assert (done.returncode, message in output) == (exit_status, True), output
    assert "raw events are missing" not in output


def test_what_a_finding_names(processes: Any, fixtures_dir: Path) -> None:
    """The side, the bytes, the addresses, the packet as Wireshark counts, and the time of day."""
    file = fixtures_dir / "captures" / "field" / "complaint-2.pcapng"
    output = processes.run("audit", f"{file}").stdout
    (line,) = (each for each in output.splitlines() if each.startswith("fail"))
    assert " · controller · " in line
    assert "C2A byte 20, 41 bytes, 127.0.0.1:55086 → 127.0.0.1:8877, packet 13, 2026-" in line
    assert "C2A: from the controller" in output


def test_losses_are_printed(processes: Any, fixtures_dir: Path) -> None:
    """Nothing is called conformant if bytes are missing."""
    file = fixtures_dir / "captures" / "field" / "plant-a-torn.pcapng"
    done = processes.run("audit", f"{file}")
    assert done.returncode == 3
    assert "no violation found in what was recorded (4 losses, 36 bytes, and more" in done.stdout
    assert "loss · 28 bytes · connection 1, A2C byte 83, " in done.stdout
