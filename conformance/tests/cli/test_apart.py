"""Work on several processes."""

import os
from collections import Counter

from scaraspec.cli.prove.apart import apart


def test_all_is_done_in_order_and_no_process_grows_old() -> None:
    """However much there is, with processes that work twice each."""
    assert list(apart(abs, range(-9, 0), jobs=1, runs=2)) == list(range(9, 0, -1))
    workers = Counter(apart(os.readlink, ["/proc/self"] * 5, jobs=1, runs=2))
    assert sorted(workers.values()) == [1, 2, 2]
