"""Reading results and writing summaries, for the commands that compare results."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scaraspec.cli.problems import Problem, unwritable
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.model import Results, ResultsError
from scaraspec.results.baseline import BaselineError
from scaraspec.results.findings import OldResultsError, contradiction, failures
from scaraspec.results.waivers import WaiverError
from scaraspec.user_message import UserMessage, sentence_of


def results_in(path: Path) -> Results:
    """Read results: a results.json, or the one in the folder of a run.

    Raises:
        ResultsError: The file cannot be read as results, is too old, or contradicts itself.
    """
    file = path / "results.json" if os.path.isdir(path) else path  # noqa: PTH112 - no OSError
    results = Results.read(file)
    if problem := contradiction(results):
        raise ResultsError(UserMessage("{path} was altered: {problem}", path=file, problem=problem))
    try:
        failures(results)
    except OldResultsError as error:
        raise ResultsError(UserMessage("{path}: {error}", path=file, error=error)) from None
    return results


def append_summary(path: Path | None, text: str) -> None:
    """Append Markdown to a file, if there is one.

    Raises:
        OSError: The file cannot be written.
    """
    if path:
        with path.open("a", encoding="utf-8") as file:
            file.write(text)


@contextmanager
def user_errors(*, worse: bool = False) -> Iterator[None]:
    """Turn errors that a user can cause into one sentence.

    Args:
        worse: Exit status 1 is known already, also if a file cannot be written.
    """
    try:
        yield
    except (ResultsError, BaselineError, WaiverError) as error:
        raise Problem(sentence_of(error)) from None
    except OSError as error:
        status = ExitStatus.NONCONFORMANT if worse else ExitStatus.INCONCLUSIVE
        raise unwritable(error, status) from None
