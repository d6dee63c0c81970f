"""Mutants of the reference client, each with one fault; see `mutants.registry`.

A mutant is a row with operators, or a class if it keeps state. The class derives from `ClientCore`,
or from `AsyncClient` if the fault is in the shell: in files or in returned values.
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
    """Return the client class of a mutant."""
    if issubclass(wrong, ClientCore):
        return type(wrong.__name__, (AsyncClient,), {"core": wrong})
    assert issubclass(wrong, AsyncClient), f"{wrong} is neither a core nor a shell"
    return wrong


_MUTANTS: Final = registry.MutantRegistry[type[AsyncClient]](_client)
mutant = _MUTANTS.mutant
row = _MUTANTS.row


@cache
def mutants() -> Mapping[str, ClientMutant]:
    """Return all mutants by id, in the order of the clauses of the document."""
    return _MUTANTS.all(sys.modules[__name__])
