"""Work on several processes."""

import os
import select
import subprocess
import sys
from collections import Counter
from contextlib import closing
from pathlib import Path

import pytest

from scaraspec.mutants.worker_pool import apart

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux watches a process")

HERE = "__import__('os').getpid(), __import__('tempfile').mkdtemp()"
FOR_LONG = "__import__('time').sleep(60)"
LEFT = f"""
from scaraspec.mutants.worker_pool import apart
for told in apart(eval, ["{HERE}", "{FOR_LONG}", "{FOR_LONG}"], jobs=1, runs=3):
    print(*told, flush=True)
"""


def gone(watch: int) -> bool:
    """Whether a process has ended, soon."""
    with open(watch) as _:
        return bool(select.select([watch], [], [], 30)[0])


def test_all_is_done_in_order_and_no_process_grows_old() -> None:
    """However much there is, with processes that work twice each."""
    assert list(apart(abs, range(-9, 0), jobs=1, runs=2)) == list(range(9, 0, -1))
    workers = Counter(apart(os.readlink, ["/proc/self"] * 5, jobs=1, runs=2))
    assert sorted(workers.values()) == [1, 2, 2]


def test_whoever_leaves_waits_for_no_work(tmp_path: Path) -> None:
    """Though the processes are in the midst of it; nothing of theirs is left."""
    done = tmp_path / "done"
    work = f"{FOR_LONG}, __import__('pathlib').Path({str(done)!r}).touch()"
    with closing(apart(eval, [HERE, work], jobs=1, runs=2)) as results:
        number, folder = next(results)
        watch = os.pidfd_open(number)
    assert gone(watch)
    assert not done.exists()
    assert not Path(folder).parent.exists()


def test_processes_end_with_whoever_is_killed() -> None:
    """They would work on, and wait for ever for more."""
    with subprocess.Popen(
        [sys.executable, "-c", LEFT], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as whoever:
        assert whoever.stdout
        number, folder = whoever.stdout.readline().split()
        watch = os.pidfd_open(int(number))
        whoever.kill()
    assert gone(watch)
    assert not Path(folder).parent.exists()
