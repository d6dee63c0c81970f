"""Children: what a terminal sends to all processes at once is for the recorder alone."""

import subprocess
import sys

FIRST = """
import multiprocessing, signal
from scaraspec_recorder.children import _held_back
with _held_back():
    process = multiprocessing.get_context("spawn").Process(target=int)
    process.start()
    held = signal.pthread_sigmask(signal.SIG_BLOCK, ())
process.join()
print(signal.SIGINT in held and signal.SIGTERM in held, process.exitcode)
"""


def test_the_first_child_is_held_back_too() -> None:
    """With the first one Python starts a helper of its own, which lets signals through again."""
    done = subprocess.run(
        [sys.executable, "-c", FIRST], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout == "True 0\n", done.stderr
