"""Progress bar: counts what a command has done, on a terminal only."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich import progress as bars
from rich.console import Console

from scaraspec.translation import localized


class ProgressBar(bars.Progress):
    """A bar with a count and the elapsed time; nothing is shown if the output is no terminal.

    Args:
        console: The output.
        text: What is done.
        count: How often it is done.
        last: The last column: the time that is left.
        hidden: Show nothing on a terminal, either.
        transient: Remove the bar at the end.
        fields: The initial fields of `last`.
    """

    def __init__(  # noqa: PLR0913 - independent properties of a bar
        self,
        console: Console,
        text: str,
        count: int,
        last: bars.ProgressColumn,
        *,
        hidden: bool = False,
        transient: bool = False,
        **fields: Any,
    ) -> None:
        super().__init__(
            bars.TextColumn("{task.description}"),
            bars.BarColumn(),
            bars.MofNCompleteColumn(),
            bars.TimeElapsedColumn(),
            last,
            console=console,
            disable=hidden or not console.is_terminal,
            transient=transient,
        )
        self._only_task = self.add_task(text, total=count, **fields)

    def count_one(self, text: str, **fields: Any) -> None:
        """Count one more, with its text and the fields of the last column."""
        self.update(self._only_task, advance=1, description=text, **fields)

    def set_fields(self, **fields: Any) -> None:
        """Show other fields in the last column."""
        self.update(self._only_task, **fields)


@contextmanager
def shown_share(
    text: str, unit: str = "", *, hidden: bool = False
) -> Iterator[Callable[[int, int], None]]:
    """Show on a terminal how much of a known amount is done, and how long the rest takes.

    Args:
        text: What is done.
        unit: What is counted; empty to show only the share.
        hidden: Show nothing on a terminal, either.

    Yields:
        The function that takes what is done and the amount.
    """
    console = Console(stderr=True)
    disabled = hidden or not console.is_terminal
    counted = (bars.MofNCompleteColumn(), bars.TextColumn(unit)) if unit else ()
    columns = (
        *(bars.TextColumn(text), bars.BarColumn(), bars.TaskProgressColumn(), *counted),
        *(bars.TimeElapsedColumn(), bars.TimeRemainingColumn(), bars.TextColumn(localized("left"))),
    )
    with bars.Progress(*columns, console=console, transient=True, disable=disabled) as bar:
        task = bar.add_task(text, total=None)
        yield lambda done, amount: bar.update(task, completed=done, total=amount)
