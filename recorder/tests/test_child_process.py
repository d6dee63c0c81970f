"""Child processes: end by the control line, and immediate exit after a reported failure."""

import asyncio
import subprocess
import sys
from pathlib import Path

import pytest

from failing_child import fail_once, lack_files
from scaraspec_recorder.child_process import ChildProcess

FIRST = """
import multiprocessing, signal
from scaraspec_recorder.child_process import _blocked_signals
with _blocked_signals():
    process = multiprocessing.get_context("spawn").Process(target=int)
    process.start()
    held = signal.pthread_sigmask(signal.SIG_BLOCK, ())
process.join()
print(signal.SIGINT in held and signal.SIGTERM in held, process.exitcode)
"""


def test_the_first_child_blocks_signals() -> None:
    """Python starts a helper process with the first child, which unblocks signals again."""
    done = subprocess.run(
        [sys.executable, "-c", FIRST], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout == "True 0\n", done.stderr


def test_a_child_that_reported_its_failure_does_not_wait_for_threads(tmp_path: Path) -> None:
    """A thread of a library may never end; the recording must not wait for it."""

    async def live() -> bool:
        child = ChildProcess("once", fail_once, tmp_path / "lives")
        child.start()
        assert child._supervisor
        await asyncio.wait_for(asyncio.shield(child._supervisor), 30)
        return await child.stop(30)

    assert asyncio.run(live())


def test_a_child_without_files(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """It says so in one sentence and is started again."""

    async def live() -> None:
        child = ChildProcess("hungry", lack_files, tmp_path / "lives")
        child.start()
        assert child._supervisor
        await asyncio.wait_for(asyncio.shield(child._supervisor), 30)
        assert child.failures == 1
        assert await child.stop(30)

    asyncio.run(live())
    printed = capfd.readouterr().err
    assert "the hungry process cannot continue: [Errno 24] Too many open files\n" in printed
    assert "Traceback" not in printed
