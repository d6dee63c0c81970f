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

ClientMutant = registry.Mutant[type[AsyncClient]]


def _client(wrong: type[Any]) -> type[AsyncClient]:
    """The client that a fault makes."""
    if issubclass(wrong, ClientCore):
        return type(wrong.__name__, (AsyncClient,), {"core": wrong})
    assert issubclass(wrong, AsyncClient), f"{wrong} is neither a core nor a shell"
    return wrong


_MUTANTS: Final = registry.MutantRegistry[type[AsyncClient]](_client)
mutant = _MUTANTS.mutant


@cache
def mutants() -> Mapping[str, ClientMutant]:
    """All seeded faults by name, in the order of the document's clauses."""
    return _MUTANTS.all(sys.modules[__name__])
