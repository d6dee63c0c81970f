"""Children: they obey their line alone, and the one that says why it ends ends at once."""

import asyncio
import subprocess
import sys
from pathlib import Path

from failing_child import fail_once
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


def test_the_first_child_is_blocked_signals_too() -> None:
    """With the first one Python starts a helper of its own, which lets signals through again."""
    done = subprocess.run(
        [sys.executable, "-c", FIRST], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout == "True 0\n", done.stderr


def test_a_child_that_said_why_it_fails_waits_for_none_of_its_threads(tmp_path: Path) -> None:
    """A library's may wait for ever, and so would the recording."""

    async def live() -> bool:
        child = ChildProcess("once", fail_once, tmp_path / "lives")
        child.start()
        assert child._supervisor
        await asyncio.wait_for(asyncio.shield(child._supervisor), 30)
        return await child.stop(30)

    assert asyncio.run(live())
