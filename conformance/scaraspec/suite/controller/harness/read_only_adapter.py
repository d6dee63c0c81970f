"""Read-only adapter: asks a controller what can be seen without changing anything."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.requests.queries import QUERIES, Query, supported_queries
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import NoReply

_DEFAULT_PROGRAM: Final = Query("get_default_program")


@dataclass(frozen=True)
class ReadOnlyAdapter(ControllerAdapter):
    """A run that sends only logins and queries. Nothing is restored, because nothing changes.

    The options must permit no hazard and select no case.

    Attributes:
        replies: The reply to each query; None if there was none.
    """

    replies: dict[str, ReceivedFrame | None] = field(default_factory=dict)

    def begin(self, subject: ControllerUnderTest) -> Mapping[str, Any]:
        """Log in.

        Raises:
            CaseFailed: The controller cannot be reached.
        """
        subject.open().close()
        return {}

    def probe(self, subject: ControllerUnderTest) -> None:
        """Find out which readings the controller follows, and send each query once."""
        super().probe(subject)
        line = subject.open()
        for query in supported_queries(subject, [*QUERIES, _DEFAULT_PROGRAM], unanswered=True):
            try:
                self.replies[query.name] = line.ask(*query)
            except NoReply:
                self.replies[query.name] = None
                line.close()
                line = subject.open()
        line.close()
