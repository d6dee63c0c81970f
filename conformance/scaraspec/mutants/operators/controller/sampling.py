"""Sampling: controllers that report the state of the last cycle of a task (A-4.8-3)."""

import math
from typing import Any, Final, NamedTuple

from scaraspec.virtual_controller.core import ControllerCore

STATUS: Final = ("get_status",)
POSE: Final = ("get_tool_coordinates", "get_joint_angles")
INPUTS: Final = ("get_digital_inputs",)


class _Cycle(NamedTuple):
    """Takes the place of a request."""

    now_s: float


def sampling(period_s: float, *queries: str) -> type[ControllerCore]:
    """Return a controller that answers these queries with the state of the last cycle.

    Args:
        period_s: The period of the cycle, in seconds.
        queries: The names of the queries.
    """

    class Sampling(ControllerCore):
        _number = -1

        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            self._sampled: dict[str, Any] = {}

        def _process_due(self, now_s: float) -> None:
            number = math.floor(now_s / period_s)
            if number > self._number:
                self._number = number
                super()._process_due(number * period_s)
                cycle: Any = _Cycle(number * period_s)
                for query in queries:
                    self._sampled[query] = getattr(super(), query)(cycle)
            super()._process_due(now_s)

        @property
        def next_event_s(self) -> float | None:
            """An input may change at any time, and must be sampled before it changes."""
            next_s = super().next_event_s
            if not {*INPUTS} & {*queries}:
                return next_s
            return min((self._number + 1) * period_s, next_s or math.inf)

    for query in queries:
        setattr(Sampling, query, lambda core, _, query=query: core._sampled[query])  # noqa: SLF001 - its own
    return Sampling
