"""Results of a small run."""

from dataclasses import replace

import pytest
from results_of_run import FAILED, PASSED, SEEN, results_of

from scaraspec.judge.verdicts import Verdict
from scaraspec.report.model import Results


@pytest.fixture
def results() -> Results:
    """Return a run with a passed case, a failed case and a finding of the judge."""
    return results_of(PASSED, FAILED, SEEN)


@pytest.fixture
def good() -> Results:
    """Return a run without a failure."""
    return results_of(PASSED, replace(FAILED, verdict=Verdict.PASS, message="", fingerprint=""))
