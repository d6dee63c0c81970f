"""ICS check: mistakes and contradictions in a statement, before anything is tested."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

from scaraspec.protocol.readings import ReadingError
from scaraspec.suite.engine.ics import Ics, IcsError
from scaraspec.transports.link import LinkError
from scaraspec.transports.url import parse
from scaraspec.user_message import UserMessage, sentence_of

_TRANSFERS: Final = ("upload_name", "download_name")
_RUNS: Final = ("run_program", "simulate_program")
_POSES: Final = ("get_tool_coordinates", "set_tool_coordinates")
_HOME: Final = ("get_initial_tool_position", "set_initial_tool_position")
_COMMANDS: Final[Mapping[str, tuple[str, ...]]] = {
    "runinfo_binary": ("get_running_program",),
    "prelogin": ("login",),
    "runinfo_none": ("get_running_program",),
    "list_prefix_sep": ("list_programs",),
    "list_cont": ("list_programs",),
    "list_empty": ("list_programs",),
    "delete_guard": ("delete_program",),
    "op_get_default": ("get_default_program",),
    "default_none": ("get_default_program",),
    "op_temp_reply": ("get_motor_temperatures",),
    "estop_interrupted": ("emergency_stop",),
    "reset_from_error": ("reset",),
    "theta_yz": (*_HOME, *_POSES),
    "pose_point": _POSES,
    "err_bare0": ("set_tool_coordinates",),
    "jog_byte": ("jog",),
    "chunk_trunc": _TRANSFERS,
    "chunk_order": _TRANSFERS,
    "empty_file": _TRANSFERS,
    "partial_keep": ("upload_name",),
    "xfer_timeout": _TRANSFERS,
    "xfer_concurrency": _TRANSFERS,
    "loop_iter": _RUNS,
}
"""The commands of which a reading states something; other readings are about many commands."""

_PARTS: Final = (("upload_name", "upload_chunk"), ("download_name", "download_chunk"))
"""Commands that are of no use without each other."""

_EXCLUDE: Final = (
    (
        {"name_max": "255", "trailing_nul": "yes"},
        "a name of 255 bytes leaves no place for its NUL in a frame",
    ),
)
"""Options of different readings that exclude each other, and why."""

_HOOK_PAIRS: Final = (
    ("stop", "start"),
    ("disk_full", "disk_free"),
    ("motor_fault", "clear_faults"),
    ("position_fault", "clear_faults"),
    ("angle_fault", "clear_faults"),
)
"""A hook, and the one that undoes it."""


def problems_of(document: Mapping[str, Any]) -> list[str]:
    """Return the mistakes in a TOML document, or else the contradictions; a sentence each."""
    return [*_mistakes(document)] or [*_contradictions(Ics.of(document), document)]


def _mistakes(document: Mapping[str, Any]) -> Iterator[str]:
    """Yield what is wrong with each key alone."""
    for name, table in document.items():
        entries = table if isinstance(table, dict) and table else {"": None}
        for key, value in entries.items():
            alone = {name: {key: value}} if key else {name: table}
            try:
                Ics.of(alone)
            except (IcsError, ReadingError) as error:
                yield sentence_of(error)


def _contradictions(ics: Ics, document: Mapping[str, Any]) -> Iterator[str]:
    yield from _about_lacks(ics, document)
    yield from _about_the_link(ics)
    claims = {key: ics.dialect[key] for key in ics.claimed}
    for options, why in _EXCLUDE:
        if options.items() <= claims.items():
            named = " and ".join(f"readings.{k} = {v}" for k, v in options.items())
            yield UserMessage("{options} exclude each other: {why}", options=named, why=why)
    for hook, undo in _HOOK_PAIRS:
        if hook in ics.hooks and undo not in ics.hooks:
            yield UserMessage(
                "hooks.{hook} is given without hooks.{undo}, which undoes it", hook=hook, undo=undo
            )
    step_mm, box = ics.motion.step_mm, ics.motion.box_mm
    if box and all(high - low < step_mm for low, high in box):
        yield UserMessage(
            "motion.step_mm = {step:g} is longer than every side of motion.box_mm", step=step_mm
        )


def _about_lacks(ics: Ics, document: Mapping[str, Any]) -> Iterator[str]:
    lacks = ics.unsupported
    for key in sorted(ics.claimed):
        commands = _COMMANDS.get(key, ())
        if commands and lacks.issuperset(commands):
            yield UserMessage(
                "readings.{key} is claimed, but subject.lacks names {commands}",
                key=key,
                commands=" and ".join(commands),
            )
    for parts in _PARTS:
        missing = [name for name in parts if name in lacks]
        if len(missing) == 1:
            (other,) = {*parts} - {*missing}
            yield UserMessage(
                "subject.lacks names {missing}, but not {other}: one is of no use without the "
                "other",
                missing=missing[0],
                other=other,
            )
    if "network_applies" in document.get("subject", {}) and "set_network" in lacks:
        yield "subject.network_applies is stated, but subject.lacks names set_network"


def _about_the_link(ics: Ics) -> Iterator[str]:
    if not ics.url:
        return
    try:
        link = parse(ics.url)
    except LinkError as error:
        yield UserMessage("subject.url: {error}", error=error)
        return
    if link.needs_login:
        if "login" in ics.unsupported:
            yield "subject.lacks names login, but subject.url is a TCP link, which needs one (L83)"
        return
    for key in ("prelogin", "max_clients"):
        if key in ics.claimed:
            yield UserMessage(
                "readings.{key} is claimed, but subject.url has no login and one connection (L83)",
                key=key,
            )
