"""The worker pool runs work in several processes and ends them."""

import os
import select
import subprocess
import sys
from collections import Counter
from contextlib import closing
from pathlib import Path

import pytest

from scaraspec.mutants.worker_pool import in_processes

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux watches a process")

HERE = "__import__('os').getpid(), __import__('tempfile').mkdtemp()"
FOR_LONG = "__import__('time').sleep(60)"
LEFT = f"""
from scaraspec.mutants.worker_pool import in_processes
for printed in in_processes(eval, ["{HERE}", "{FOR_LONG}", "{FOR_LONG}"], jobs=1, runs=3):
    print(*printed, flush=True)
"""


def gone(watch: int) -> bool:
    """Return whether the process ends within 30 s."""
    with open(watch) as _:
        return bool(select.select([watch], [], [], 30)[0])


def test_results_are_in_order_and_workers_are_replaced() -> None:
    """Nine calls are run in order by workers that run two calls each."""
    assert list(in_processes(abs, range(-9, 0), jobs=1, runs=2)) == list(range(9, 0, -1))
    workers = Counter(in_processes(os.readlink, ["/proc/self"] * 5, jobs=1, runs=2))
    assert sorted(workers.values()) == [1, 2, 2]


def test_close_does_not_wait_for_pending_work(tmp_path: Path) -> None:
    """Workers are ended during their work, and their temporary files are deleted."""
    done = tmp_path / "done"
    work = f"{FOR_LONG}, __import__('pathlib').Path({str(done)!r}).touch()"
    with closing(in_processes(eval, [HERE, work], jobs=1, runs=2)) as results:
        number, folder = next(results)
        watch = os.pidfd_open(number)
    assert gone(watch)
    assert not done.exists()
    assert not Path(folder).parent.exists()


def test_workers_end_when_the_parent_is_killed() -> None:
    """Without the pipe they would finish their work and then wait forever."""
    with subprocess.Popen(
        [sys.executable, "-c", LEFT], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as parent:
        assert parent.stdout
        number, folder = parent.stdout.readline().split()
        watch = os.pidfd_open(int(number))
        parent.kill()
    assert gone(watch)
    assert not Path(folder).parent.exists()
