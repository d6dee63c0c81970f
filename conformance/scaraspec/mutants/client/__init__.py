"""Seeded faults: reference clients that are wrong on purpose, one way each; see `mutants.registry`.

A fault is a `ClientCore`, or an `AsyncClient` where it spoils the shell: files, values told.
"""

import sys
from collections.abc import Mapping
from functools import cache
from typing import Any, Final

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore
from scaraspec.mutants import registry

Fault = registry.Fault[type[AsyncClient]]


def _client(wrong: type[Any]) -> type[AsyncClient]:
    """The client that a fault makes."""
    if issubclass(wrong, ClientCore):
        return type(wrong.__name__, (AsyncClient,), {"core": wrong})
    assert issubclass(wrong, AsyncClient), f"{wrong} is neither a core nor a shell"
    return wrong


_FAULTS: Final = registry.Faults[type[AsyncClient]](_client)
fault = _FAULTS.fault


@cache
def faults() -> Mapping[str, Fault]:
    """All seeded faults by name, in the order of the document's clauses."""
    return _FAULTS.all(sys.modules[__name__])
