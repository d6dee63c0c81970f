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
        ("two-recordings-merged.mcap", "", 2, "audit each recording by itself"),
        (
            "late-thread.pcap",
            "",
            3,
            "inconclusive · 3/31 · get_digital_outputs was answered after 6.0",
        ),
        ("late-run.pcap", "", 3, "the client may have taken the reply to the first request"),
        ("settle.pcap", "", 0, "observed status_lag"),
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
