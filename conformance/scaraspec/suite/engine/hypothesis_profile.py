"""Hypothesis profile: how hypothesis draws for a run, which a seed alone decides.

By itself it tries constants of the modules that it takes for the user's own as well. Those are all
of ours in a source tree and none in an installation, and of a tree those that happen to be loaded:
neither may decide what a case tries. There is no setting for that: it is taken from where it stands
now, and a hypothesis that has moved it draws as it pleases.
"""

from typing import Final

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis.internal.conjecture import providers

_PROFILE: Final = "scaraspec-suite"


class HypothesisProfile:
    """Settles how hypothesis draws, from `begin` to `end`.

    Args:
        examples: How many values a drawn case tries.
    """

    def __init__(self, examples: int) -> None:
        self._examples = examples
        self._before = settings.get_current_profile_name()
        self._patch = pytest.MonkeyPatch()

    def begin(self) -> None:
        """Draw as the suite does from now on."""
        self._before = settings.get_current_profile_name()
        settings.register_profile(
            _PROFILE,
            derandomize=False,  # the draws depend on the seed of the run alone
            max_examples=self._examples,
            deadline=None,
            database=None,
            phases=(Phase.explicit, Phase.generate, Phase.shrink),
            suppress_health_check=list(HealthCheck),
            print_blob=False,
        )
        settings.load_profile(_PROFILE)
        none = getattr(providers, "Constants", tuple)
        self._patch.setattr(providers, "_get_local_constants", none, raising=False)
        _forget()

    def end(self) -> None:
        """Draw as before."""
        settings.load_profile(self._before)
        self._patch.undo()
        _forget()


def _forget() -> None:
    """Let constants that were found be found again."""
    if found := getattr(providers, "CONSTANTS_CACHE", None):
        found.cache.clear()
