"""Options that both certifications share."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from scaraspec.cli.options import F, Percentage, Real, given_options
from scaraspec.cli.problems import Problem
from scaraspec.cli.vocabulary import WORDS
from scaraspec.operating_system import join_command
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.report.model import Results

PATH: Final = click.Path(path_type=Path)


def option(name: str, *names: str, **more: Any) -> Callable[[F], F]:
    """Return the click option of a word of the vocabulary.

    Args:
        name: The word.
        names: Other names of the option, such as ``-y``.
        more: Further arguments of `click.option`.
    """
    word = WORDS[name]
    known: dict[str, Any] = {"help": word.help}
    if word.metavar is None:
        known["is_flag"] = True
    elif word.default is None:
        known["metavar"] = word.metavar
    else:
        known |= {"metavar": word.metavar, "default": word.default, "show_default": True}
    return click.option(f"--{name}", *names, **(known | more))


def _earlier_results(
    context: click.Context, _option: click.Parameter, path: Path | None
) -> "Results | None":
    """Read the results of ``--rerun-from``; their settings become the defaults of the options.

    Raises:
        Problem: The results cannot be read, are those of the other role, or state no settings.
    """
    if path is None:
        return None
    from scaraspec.cli.certify.preparation import user_errors  # noqa: PLC0415 - the suite
    from scaraspec.cli.results import results_in  # noqa: PLC0415 - only this option needs it

    with user_errors():
        results = results_in(path)
    if results.role.value != context.info_name:
        role = UserMessage(results.role.value)
        raise Problem(UserMessage("{path} has the results of a {role}", path=path, role=role))
    if results.run is None:
        raise Problem(
            UserMessage("{path} states no settings: certify without --rerun-from", path=path)
        )
    known = {option.name for option in context.command.params} - _PERMISSIONS
    settings = {_RENAMED.get(key, key): value for key, value in results.run.settings.items()}
    settings |= {
        option: f"{results.subject.claims[claim]}{unit}"
        for option, claim, unit in _CLAIMED
        if claim in results.subject.claims
    }
    settings["seed"] = f"{results.run.seed}"
    context.default_map = {k: v for k, v in settings.items() if k in known and v}
    return results


_PERMISSIONS: Final = {"allow", "undefined_opcodes"}
"""Options that permit a hazard: each command line must name them itself."""
_RENAMED: Final = {"patience_s": "patience", "answer_timeout_s": "answer_timeout"}
"""Options whose setting in the results has another name."""
_CLAIMED: Final = (
    ("reply_timeout", "readings.reply_timeout", "s"),
    ("transfer_timeout", "readings.xfer_timeout", ""),
)
"""Options that are claims, and the unit of their value."""

_OPTIONS: Final[Sequence[Callable[[Any], Any]]] = (
    option("ics", type=PATH),
    option("transfer-timeout", type=Real(0.1, 3600)),
    option("only"),
    click.option(
        "--rerun-from",
        type=PATH,
        metavar="RESULTS",
        is_eager=True,
        callback=_earlier_results,
        help="Repeat what failed, was inconclusive or did not run, with the options of that run; "
        "--allow must be given again.",
    ),
    option("require"),
    option("require-coverage", type=Percentage(), default=0.0),
    option("seed", type=int),
    option("examples", type=click.IntRange(1, 100_000)),
    option("exhaustive"),
    option("fail-fast"),
    option("out", type=PATH),
    click.option(
        "--certification",
        is_flag=True,
        help="Run all mandatory cases with fixed options, and write a package.",
    ),
    click.option(
        "--package",
        type=PATH,
        metavar="FILE",
        help="The package of --certification [OUT.scaraspec.zip].",
    ),
    click.option("--dry-run", is_flag=True, help="Print the plan and send nothing."),
)


def suite_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of both certifications to a command."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


_NOT_REPEATED: Final = frozenset(
    {
        "certification",
        "fail_fast",
        "only",
        "out",
        "package",
        "yes",
        "dry_run",
        "password",
        "rerun_from",
        "state_dir",
        "wait_for",
        "wait_for_lock",
    }
)
"""Parameters that do not change what a run finds, and the password, which no report shows."""


def reproduction(context: click.Context, url: str = "") -> str:
    """Return the command that repeats a run exactly, without ``--only``.

    Args:
        context: The context of the command; its options that were given are repeated.
        url: The URL of the controller; empty for a client.
    """
    words = ["scaraspec", "certify", *([context.info_name] if context.info_name else []), url]
    options = given_options(context, without=_NOT_REPEATED, always=("seed",))
    return join_command([*filter(None, words), *options])
