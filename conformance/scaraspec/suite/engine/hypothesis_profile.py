"""Hypothesis profile: makes the draws of a run depend on its seed only.

By default, hypothesis also tries constants from local modules. In a source tree these are the
loaded modules of scaraspec, in an installation there are none, so the draws would differ. No
setting disables this, so this module patches a private function of hypothesis. If a version of
hypothesis has no such function, the constants are tried. The folder in which hypothesis writes is
patched in the same way, because it can be set but not be read: it is the user's again afterwards.

The seed is set as hypothesis' own pytest option ``--hypothesis-seed`` sets it: it applies to the
functions that a case makes while it runs, too.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Final

import pytest
from hypothesis import HealthCheck, Phase, configuration, core, settings
from hypothesis.internal.conjecture import providers

_PROFILE: Final = "scaraspec-suite"


class HypothesisProfile:
    """The hypothesis settings of a run, active within the context.

    Args:
        examples: How many values a case tries that draws its values.
        seed: The seed of all draws.
    """

    def __init__(self, examples: int, seed: int) -> None:
        self._examples, self._seed = examples, seed
        self._before = settings.get_current_profile_name()
        self._patch = pytest.MonkeyPatch()

    def __enter__(self) -> None:
        """Load the profile of the suite."""
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
            report_multiple_bugs=False,  # a case reports one failure
        )
        settings.load_profile(_PROFILE)
        self._patch.setattr(core, "global_force_seed", self._seed)
        _hide_constants(self._patch)
        _clear_constants()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        raised: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Load the earlier profile."""
        settings.load_profile(self._before)
        self._patch.undo()
        _clear_constants()


@contextmanager
def without_files() -> Iterator[None]:
    """Keep hypothesis from reading the local modules, and from writing where the user works.

    It would read hundreds of files while it collects cases, and write a table of characters into a
    folder ``.hypothesis``.
    """
    with TemporaryDirectory(prefix="scaraspec-") as folder, pytest.MonkeyPatch.context() as patch:
        _hide_constants(patch)
        patch.setattr(configuration, "__hypothesis_home_directory", Path(folder), raising=False)
        yield


def _hide_constants(patch: pytest.MonkeyPatch) -> None:
    """Hide the constants of local modules from hypothesis."""
    no_constants = getattr(providers, "Constants", tuple)
    patch.setattr(providers, "_get_local_constants", no_constants, raising=False)


def _clear_constants() -> None:
    """Clear the cache of constants, so that hypothesis collects them again."""
    if constants := getattr(providers, "CONSTANTS_CACHE", None):
        constants.cache.clear()
