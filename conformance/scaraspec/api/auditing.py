"""Audit: judges a capture file and returns the results."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Final

from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Conclusion, Finding
from scaraspec.operating_system import join_command
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.report.audit import from_audit
from scaraspec.report.evidence import evidence_of
from scaraspec.report.model import Case, Results, Role, Subject
from scaraspec.report.session import SessionStats
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import sending_direction
from scaraspec.suite.engine.unsupported_claims import (
    answers,
    excluded_requirements,
    wrong_claims,
)
from scaraspec.traffic.events import Ending, Exchange, TrafficEvent
from scaraspec.traffic.selection import EVERYTHING as ALL_TRAFFIC
from scaraspec.traffic.selection import Selection
from scaraspec.traffic.wire import UNJUDGED, Kind, WireEvent
from scaraspec.transports.url import parse
from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.sinks.mcap.mcap_sink import CLAIM, MASKED, PASSWORDS, SUBJECT
from scaraspec_recorder.sources.capture import McapCapture, PcapCapture, open_capture
from scaraspec_recorder.sources.joined import JoinedCapture

_MAX_NAMED: Final = 10
_EVENTS_PER_UPDATE: Final = 1000
_INTERRUPTED: Final = "Interrupted: the rest of the capture was not judged."
_ON_PASSWORDS: Final = frozenset({"4.1/2", "4.1/3", "4.2/3"})
"""Requirements that masked passwords make undecidable."""
_OTHER_SIDE: Final = {Role.CONTROLLER: "client", Role.CLIENT: "controller"}


def audit(  # noqa: PLR0913 - independent options of an audit
    file: Path | Sequence[Path],
    *,
    subject: Role | None = None,
    ics: Ics | None = None,
    readings: Mapping[str, str] | None = None,
    port: int | None = None,
    serial: bool = False,
    only: frozenset[str] | None = None,
    selection: Selection = ALL_TRAFFIC,
    reproduction: str = "",
    progress: Callable[[int, int], None] = lambda _read, _size: None,
    observe: Callable[[TrafficEvent | Finding], None] = lambda _item: None,
) -> tuple[Results, tuple[str, ...]]:
    """Judge a capture: an MCAP recording, or a pcap or pcapng of any client and controller.

    Args:
        file: The capture, or the files of one recording in the order of time, see `recordings`.
        subject: The side that is judged; `Role.CAPTURE` for both sides. Findings about the other
            side are only counted. None for the subject of the certification that wrote the
            capture, or both sides of any other capture.
        ics: What the subject claims, or the controller if both sides are judged. None for the
            claims that the certification has written into the capture.
        readings: Further claimed readings by key.
        port: The controller's TCP port in packet captures; None for all connections of this
            protocol.
        serial: Whether the link was serial (L83), even if neither the file nor the ICS states it.
        only: The requirements that are judged; None for all.
        selection: The traffic that is judged. The other traffic is read, too, because it changes
            the state of the robot.
        reproduction: The command that repeats the audit, for the report.
        progress: Called from time to time with the bytes read so far and the size of the files.
        observe: Called with each traffic event, and at the end with the findings of the results
            other than passes: of each requirement and verdict the first 50.

    Returns:
        The results, and one sentence for each defect of the file. If the file is not whole, the
        results are inconclusive at best.

    KeyboardInterrupt (Ctrl-C) ends the reading; the results are then those of the part that was
    read, and inconclusive without a failure.

    Raises:
        CaptureError: The file cannot be read, holds several recordings, or its description of the
            subject is invalid.
        ReadingError: A reading does not exist.
        UrlError: The URL in the ICS is invalid.
    """
    files = (file,) if isinstance(file, Path) else tuple(file)
    captures = [open_capture(each, port=port) for each in files]
    size_bytes = sum(each.stat().st_size for each in files)
    capture = _joined(captures)
    tested, claimed = subject_of(capture)
    subject, ics = subject or tested, (ics or claimed).with_claims(**(readings or {}))
    serial = serial or not capture.needs_login or bool(ics.url and not parse(ics.url).needs_login)
    side = None if subject is Role.CAPTURE else sending_direction(subject)
    scope = replace(ics.scope(side), only=only, selection=selection)
    if capture.session.get(PASSWORDS) == MASKED:
        scope = replace(scope, undecidable=scope.undecidable | _ON_PASSWORDS)
    judge = Judge(ics.dialect, needs_login=not serial, scope=scope, time_scale=ics.time_scale)
    replay = reproduction or join_command(["scaraspec", "audit", *map(str, files)])
    listener = _Listener(judge, ics, observe)
    interrupted = False
    try:
        for number, event in enumerate(capture):
            listener.stats.evidence.note_packet(event)
            if subject is Role.CAPTURE or listener.is_judged(event):
                listener.take(judge.feed(event))
            if number % _EVENTS_PER_UPDATE == 0:
                progress(sum(each.summary.read_bytes for each in captures), size_bytes)
        listener.take(judge.close())
    except KeyboardInterrupt:
        interrupted = True
    if isinstance(capture, McapCapture) and capture.summary.merged:
        raise CaptureError(
            UserMessage(
                "{path} holds several recordings, perhaps of different controllers: audit each "
                "recording by itself",
                path=capture.path,
            )
        )
    if isinstance(capture, PcapCapture):
        judge.discredit(capture.summary.unreliable)
    one_sided = listener.stats.one_sided()
    judge.drop_unseen(one_sided.keys())
    for finding in chain.from_iterable(tally.findings for tally in judge.tallies.values()):
        listener.observe(finding)
    results = from_audit(
        judge,
        listener.stats,
        subject=Subject(Role.CAPTURE, file=title_of(files), claims=ics.summary),
        claims={key: ics.dialect[key] for key in ics.claimed},
        replay=replay,
        wrong_claims=tuple(listener.wrong_claims(replay)),
        excluded=excluded_requirements(listener.served),
    )
    notices = (*([_INTERRUPTED] if interrupted else []), *_notices(subject, judge, listener))
    notices += tuple(_one_sided_notices(one_sided))
    if isinstance(capture, McapCapture):
        notices += tuple(
            UserMessage("Recorder: {event}. Durations across this time are wrong", event=each)
            for each in capture.summary.clock_events
        )
    results = replace(results, notices=notices)
    results = _as_recorded(results, whole=capture.summary.whole, interrupted=interrupted)
    return results, tuple(capture.summary.notes)


def _as_recorded(results: Results, *, whole: bool, interrupted: bool) -> Results:
    """Return the results; what is missing makes them inconclusive at best."""
    session = results.session and replace(results.session, incomplete=not whole)
    verdict = results.verdict
    missing = interrupted or not whole or (session and session.missing)
    if missing and verdict is not Conclusion.NONCONFORMANT:
        verdict = Conclusion.INCONCLUSIVE
    elif verdict.good and not (session and session.frames):
        verdict = Conclusion.NOTHING_TESTED
    return replace(results, session=session, verdict=verdict)


def _joined(captures: Sequence[McapCapture | PcapCapture]) -> McapCapture | PcapCapture:
    """Return the only capture, or the files of one recording as one capture.

    Raises:
        CaptureError: One of several files is a packet capture.
    """
    if len(captures) == 1:
        return captures[0]
    parts = []
    for capture in captures:
        if not isinstance(capture, McapCapture):
            raise CaptureError(
                UserMessage(
                    "{path} is no MCAP recording: audit packet captures one by one",
                    path=capture.path,
                )
            )
        parts.append(capture)
    return JoinedCapture(parts)


def title_of(files: Sequence[Path]) -> str:
    """Return the name of a capture: its file, or its first and its last file."""
    return f"{files[0]}" if len(files) == 1 else f"{files[0]} … {files[-1].name}"


def subject_of(capture: McapCapture | PcapCapture) -> tuple[Role, Ics]:
    """Return the subject that the capture states, and its claims; both sides if it states none.

    Raises:
        CaptureError: The file cannot be read, or the statement is invalid.
    """
    session = capture.session
    claims = {k.removeprefix(CLAIM): v for k, v in session.items() if k.startswith(CLAIM)}
    try:
        return Role(session.get(SUBJECT, Role.CAPTURE.value)), Ics.of_recording(claims)
    except ValueError as error:  # also IcsError
        raise CaptureError(
            UserMessage(
                "{path} has an invalid description of its subject: {error}",
                path=capture.path,
                error=error,
            )
        ) from None


class _Listener:
    """Processes the items that the judge yields.

    Attributes:
        stats: The statistics of the traffic, with the evidence of the findings that count.
        observe: Called with each traffic event.
        served: For each command that the ICS calls unsupported, and whose requests show it:
            whether the controller answers it.
        unjudged: The connections that are not judged.
    """

    def __init__(
        self, judge: Judge, ics: Ics, observe: Callable[[TrafficEvent | Finding], None]
    ) -> None:
        self.stats = SessionStats()
        self.observe = observe
        self.served: dict[str, bool] = {}
        self.unjudged: set[str] = set()
        self._refuting: dict[str, Exchange] = {}
        self._scope, self._dialect = judge.scope, ics.dialect

    def is_judged(self, event: WireEvent) -> bool:
        """Return whether the event's connection is evidence about the subject."""
        if event.kind is Kind.OPENED and event.note == UNJUDGED:
            self.unjudged.add(event.connection)
        return event.connection not in self.unjudged

    def take(self, items: Iterator[TrafficEvent | Finding]) -> None:
        """Take what follows from one wire event."""
        event: TrafficEvent | None = None
        for item in items:
            if not isinstance(item, Finding):
                event = item
                self._check_claim(item)
                self.observe(item)
            elif event is None or not self._scope.includes(item.requirement, event):
                continue
            self.stats.add(item)

    def _check_claim(self, event: TrafficEvent) -> None:
        if not (isinstance(event, Exchange) and event.name in self.unsupported and event.certain):
            return
        if event.reply and answers(event.reply.frame, self._dialect):
            self.served[event.name] = True
            self._refuting.setdefault(event.name, event)
        elif event.reply or event.overtaken or event.ending is Ending.UNANSWERED:
            self.served.setdefault(event.name, False)

    @property
    def unsupported(self) -> frozenset[str]:
        """The commands that the ICS of a controller calls unsupported."""
        return frozenset() if self._scope.side is A2C else self._scope.unsupported

    def wrong_claims(self, replay: str) -> Iterator[Case]:
        """Yield a failure for each command that is answered although it is unsupported."""
        cases = wrong_claims(self.served, replay)
        for name, case in zip(sorted(self._refuting), cases, strict=True):
            yield replace(case, wire=tuple(map(evidence_of, self._refuting[name].frames)))


def _notices(subject: Role, judge: Judge, listener: _Listener) -> Iterator[str]:
    if other := _OTHER_SIDE.get(subject):
        yield UserMessage(
            "Only the {subject} is judged. Findings about the {other} that are left out: {count}",
            subject=UserMessage(subject.value),
            other=UserMessage(other),
            count=judge.other_side,
        )
    if listener.unjudged:
        yield UserMessage(
            "Connections that are not judged, because the suite sends invalid bytes on purpose: "
            "{count}",
            count=len(listener.unjudged),
        )
    for name in sorted(listener.unsupported - listener.served.keys()):
        yield UserMessage(
            "Not verified: the ICS claims that {command} is unsupported. No request in the capture "
            "shows it",
            command=name,
        )


def _one_sided_notices(one_sided: Mapping[str, Direction]) -> Iterator[str]:
    for direction, side in ((C2A, "controller"), (A2C, "client")):
        names = [name for name, missing in one_sided.items() if missing is direction]
        if names:
            yield UserMessage(
                "One direction only: nothing that the {side} sent was captured on connection "
                "{names}. Nothing is concluded about it",
                side=side,
                names=", ".join(names[:_MAX_NAMED]) + (", …" if names[_MAX_NAMED:] else ""),
            )
