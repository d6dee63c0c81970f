"""Traits: what a run has detected about the client under test, besides its readings.

Each trait is tried once per run. None means that it has not been tried yet.
"""

from dataclasses import dataclass, field, replace


@dataclass
class ClientTraits:
    """The traits of a client.

    Attributes:
        concurrent: It runs two operations at the same time.
        requests_list_parts: It sends a request for each part of a program list (A-4.10-3).
        queries_while_executing: It starts a query while a command executes.
        starts_while_executing: For each operation, whether it starts while a program runs.
    """

    def copy(self) -> "ClientTraits":
        """Return an independent copy."""
        return replace(self, starts_while_executing=self.starts_while_executing.copy())

    # set by client_under_test
    concurrent: bool | None = None

    # set by program_lists
    requests_list_parts: bool | None = None

    # set by two_stage
    queries_while_executing: bool | None = None
    starts_while_executing: dict[str, bool] = field(default_factory=dict)
