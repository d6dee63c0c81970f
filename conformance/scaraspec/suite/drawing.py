"""Drawing: how hypothesis draws for a run, which a seed alone decides.

By itself it tries constants of the modules that it takes for the user's own as well. Those are all
of ours in a source tree and none in an installation, and of a tree those that happen to be loaded:
neither may decide what a case tries.
"""

from typing import Final

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis.internal.conjecture import providers
from hypothesis.internal.constants_ast import Constants

_PROFILE: Final = "scaraspec-suite"
_NOBODY: Final = Constants()


class Drawing:
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
            max_examples=self._examples,
            deadline=None,
            database=None,
            phases=(Phase.explicit, Phase.generate, Phase.shrink),
            suppress_health_check=list(HealthCheck),
            print_blob=False,
        )
        settings.load_profile(_PROFILE)
        self._patch.setattr(providers, "_get_local_constants", lambda: _NOBODY, raising=False)
        providers.CONSTANTS_CACHE.cache.clear()

    def end(self) -> None:
        """Draw as before."""
        settings.load_profile(self._before)
        self._patch.undo()
        providers.CONSTANTS_CACHE.cache.clear()
