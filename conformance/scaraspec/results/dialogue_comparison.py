"""Comparison of the dialogues in two captures: which requests were answered in another way.

Actions, which change the robot, are compared in their order. Queries are compared by the replies
that occur: how often a client polls says nothing about the controller. A pure function.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from difflib import SequenceMatcher
from functools import reduce
from typing import Any, Final, NamedTuple

from scaraspec.judge.tolerances import same_meaning
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.protocol.hazard import Hazard
from scaraspec.results.comparison import Change, Comparison
from scaraspec.traffic.events import Ending, Exchange
from scaraspec.user_message import UserMessage
from scaraspec_recorder.sinks import text as event_text

_POSES: Final = frozenset({"get_tool_coordinates", "get_joint_angles"})
_TRANSFERS: Final = frozenset({"upload_chunk", "download_chunk"})
_UNKNOWN: Final = UserMessage("unknown because of a loss")
_MAX_VALUES: Final = 1000
"""Kept different replies to a query."""


class _Action(NamedTuple):
    """A request that changes the robot, and how it was answered.

    Attributes:
        time_ns: When it was sent.
        request: The command with its arguments.
        outcome: Its replies; empty if a loss may have affected them.
    """

    time_ns: int
    request: str
    outcome: str


@dataclass(slots=True)
class Dialogue:
    """What a capture shows, for the comparison.

    Attributes:
        actions: The requests that change the robot, in their order.
        replies: For each query the different replies: their texts by their values.
    """

    actions: list[_Action] = field(default_factory=list)
    replies: dict[str, dict[Any, str]] = field(default_factory=lambda: defaultdict(dict))

    @classmethod
    def of(cls, exchanges: Iterable[Exchange]) -> "Dialogue":
        """Collect what is compared. Replies that a loss may have affected are not compared."""
        dialogue = cls()
        for exchange in exchanges:
            if exchange.name not in _TRANSFERS:
                dialogue._add(exchange)
        dialogue.actions.sort(key=lambda action: action.time_ns)
        return dialogue

    def _add(self, exchange: Exchange) -> None:
        request: str = exchange.name
        if data := event_text.frame_text(exchange.request):
            request = UserMessage("{name} {data}", name=request, data=data)
        outcome = _outcome(exchange) if exchange.certain else ""
        if exchange.command is None or exchange.command.hazard is not Hazard.READ_ONLY:
            self.actions.append(_Action(exchange.time_ns, request, outcome))
            return
        if not exchange.certain or (exchange.name in _POSES and exchange.concurrent):
            return  # a loss may have affected it, or the arm may move
        if exchange.parts and exchange.parts[-1].value and exchange.parts[-1].value.more:
            return  # the next request continues the list (A-4.10-3)
        replies = self.replies[request]
        value = _value(exchange)
        if len(replies) < _MAX_VALUES:
            replies.setdefault(value, outcome)


@dataclass(frozen=True, slots=True)
class DialogueComparison:
    """What differs between the dialogues of two captures.

    Attributes:
        outcomes: Actions that were answered in another way.
        actions: Actions that only one capture has at this place in their order.
        replies: Queries with replies that only one capture has.
    """

    outcomes: tuple[Change, ...]
    actions: tuple[Change, ...]
    replies: tuple[Change, ...]

    @property
    def differs(self) -> bool:
        """Whether requests are answered in another way, or other actions are requested."""
        return bool(self.outcomes or self.actions or self.replies)


@dataclass(frozen=True, slots=True)
class CaptureComparison:
    """What differs between two captures.

    Attributes:
        dialogue: The difference of the dialogues.
        judged: The difference of what the judge found.
    """

    dialogue: DialogueComparison
    judged: Comparison

    @property
    def differs(self) -> bool:
        """Whether the behaviour differs.

        A requirement or a reading that only one capture shows is no difference.
        """
        judged = self.judged
        readings = any(change.before and change.after for change in judged.readings)
        failures = judged.new or judged.gone or judged.changed
        return bool(self.dialogue.differs or failures or readings)

    @property
    def exit_status(self) -> ExitStatus:
        """The exit status: without a difference, what is missing in a capture decides."""
        if self.differs:
            return ExitStatus.NONCONFORMANT
        sessions = [each.session for each in (self.judged.before, self.judged.after)]
        if not all(session and session.frames for session in sessions):
            return ExitStatus.NOTHING_TESTED
        missing = any(session and session.missing for session in sessions)
        return ExitStatus.INCONCLUSIVE if missing else ExitStatus.CONFORMANT


def compare_dialogues(before: Dialogue, after: Dialogue) -> DialogueComparison:
    """Compare the dialogues of two captures.

    Values are equal as in `same_meaning`; poses count only while no command executes. A query that
    only one of the captures has is no difference.
    """
    outcomes, actions = _compare_actions(before.actions, after.actions)
    return DialogueComparison(
        outcomes=tuple(outcomes),
        actions=tuple(actions),
        replies=tuple(_compare_replies(before, after)),
    )


def _compare_actions(
    before: list[_Action], after: list[_Action]
) -> tuple[list[Change], list[Change]]:
    """Return the actions with other outcomes, and those that only one capture has."""
    first, second = ([action.request for action in each] for each in (before, after))
    outcomes: Counter[Change] = Counter()
    only: Counter[Change] = Counter()
    for kind, a, a_end, b, b_end in SequenceMatcher(
        None, first, second, autojunk=False
    ).get_opcodes():
        if kind == "equal":
            for old, new in zip(before[a:a_end], after[b:b_end], strict=True):
                if old.outcome and new.outcome and old.outcome != new.outcome:
                    outcomes[Change(old.request, old.outcome, new.outcome)] += 1
            continue
        for action in before[a:a_end]:
            only[Change(action.request, action.outcome or _UNKNOWN, "")] += 1
        for action in after[b:b_end]:
            only[Change(action.request, "", action.outcome or _UNKNOWN)] += 1
    return _counted(outcomes), _counted(only)


def _counted(changes: Counter[Change]) -> list[Change]:
    """Return each change once, with its number in the name."""
    return [
        change if count == 1 else replace(change, name=_times(change.name, count))
        for change, count in changes.items()
    ]


def _times(name: str, count: int) -> str:
    return UserMessage("{request} ({count} times)", request=name, count=count)


def _compare_replies(before: Dialogue, after: Dialogue) -> Iterator[Change]:
    for request in sorted(before.replies.keys() & after.replies.keys()):
        old, new = before.replies[request], after.replies[request]
        command = request.partition(" ")[0]
        gone = [text for value, text in old.items() if not _occurs(command, value, new)]
        added = [text for value, text in new.items() if not _occurs(command, value, old)]
        if gone or added:
            yield Change(request, _some(gone), _some(added))


def _occurs(command: str, value: Any, others: dict[Any, str]) -> bool:
    return value in others or any(same_meaning(command, value, other) for other in others)


def _some(texts: list[str], limit: int = 3) -> str:
    shown: str = reduce(_listed, texts[:limit], "")
    if len(texts) > limit:
        shown = UserMessage("{texts} and {count} more", texts=shown, count=len(texts) - limit)
    return shown


def _listed(texts: str, text: str) -> str:
    return UserMessage("{texts}; {text}", texts=texts, text=text) if texts else text


def _outcome(exchange: Exchange) -> str:
    replies = [event_text.frame_text(each) for each in (exchange.reply, exchange.result) if each]
    if ending := event_text.ending_text(exchange):
        replies.append(ending)
    return reduce(_followed, replies) if any(replies) else UserMessage("an empty reply")


def _followed(first: str, second: str) -> str:
    return UserMessage("{first} → {second}", first=first, second=second)


def _value(exchange: Exchange) -> Any:
    """Return what of a reply is compared: its decoded value, or how the exchange ended."""
    value = exchange.reply_value
    if exchange.ending is not Ending.ANSWERED or value is None:
        return _outcome(exchange)
    if exchange.name == "list_programs":
        parts = (part.value for part in exchange.parts if part.value)
        return tuple(name for part in parts for name in part.names)
    return value
