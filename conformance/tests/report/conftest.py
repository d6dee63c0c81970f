"""Results for the tests of the writers: complete, hostile, and of field captures."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Cause, Conclusion, Verdict
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.audit import from_audit
from scaraspec.report.failed_step import FailedStep, RootCause, Stage
from scaraspec.report.model import (
    Case,
    CommandSeen,
    ConnectionSeen,
    Evidence,
    FrameField,
    Loss,
    ReadingSeen,
    RequirementResult,
    Results,
    Role,
    RunSeen,
    Session,
    Subject,
    Timing,
    Tool,
    TransferSeen,
)
from scaraspec.report.operator_request import OperatorAnswer, OperatorRequest
from scaraspec.report.session import SessionStats
from scaraspec_recorder.sources.pcap_reader import read_pcap

HOSTILE = (
    "</script><script>alert(1)</script><!-- ]]> & \"'` onload=x \x00\x1b[31m\u202etxt.exe\ufffe"
)

_NS = 1_700_000_000_000_000_000

_FRAME = Evidence(
    "1",
    C2A,
    73,
    7,
    _NS + 566_000_000,
    "run_program, final result",
    "CC903002" + "3131AA",
    (FrameField("start", 0, 1, "C2A"), FrameField("flag", 4, 2, "11")),
)
_TIMING = Timing(3, 0.0151, 0.0357, 0.044, 0.044, ((0.013454, 1), (0.038055, 2)))

_CASES = (
    Case("3/1", ("3/1",), Verdict.PASS, message="met 12 times"),
    Case(
        "3/18",
        ("3/18",),
        Verdict.FAIL,
        Cause.SUBJECT,
        Hazard.MOTION,
        "run_program ended a second time",
        "one final result",
        "a second one",
        1.5,
        12,
        "scaraspec certify controller tcp://robot --only 3/18",
        (_FRAME, replace(_FRAME, frame_hex="", fields=())),
        step=FailedStep(_NS, Stage.RESULT, "run_program", "flag", attempt=2, dependency="4.15/5"),
    ),
    Case("4.1/2", ("4.1/2",), Verdict.NONE),
    Case("5.1/9", ("5.1/9",), Verdict.TOLERATED, Cause.SUBJECT, observed="endian = big"),
    Case("5.2/3", ("5.2/3",), Verdict.INCONCLUSIVE, Cause.DEPENDENCY, message="the link was lost"),
    Case("9/9", ("9/9",), Verdict.ERROR, Cause.SUITE, message="no such requirement"),
)

FULL = Results(
    tool=Tool("scaraspec", "0.1.0"),
    subject=Subject(
        *(Role.CONTROLLER, "Cell 7 控制器", "1.0.0", "tcp://192.168.1.2", "run.mcap"),
        claims={"readings.endian": "little"},
        complaints="it is warm in here",
    ),
    role=Role.CONTROLLER,
    verdict=Conclusion.NONCONFORMANT,
    counts=dict.fromkeys(Verdict, 1),
    readings={
        "client": {"no_such_key": ReadingSeen(("x",), default=False, mixed=False)},
        "controller": {
            "endian": ReadingSeen(("big", "little"), default=False, mixed=True, claimed="little"),
            "jog_byte": ReadingSeen(("ascii",), default=True, mixed=False, claimed="ascii"),
            "loop_iter": ReadingSeen((), default=False, mixed=False, claimed="counts"),
        },
    },
    requirements=(
        *(RequirementResult(case.id, case.verdict, (case.id,)) for case in _CASES),
        RequirementResult("8/1", Verdict.NONE),
    ),
    cases=_CASES,
    causes=(RootCause("3/18", ("3/18",), ("3/18",), ("5.2/3",)),),
    session=Session(
        begun_ns=_NS,
        ended_ns=_NS + 4_080_000_000,
        bytes={A2C: 1323, C2A: 72},
        frames=18,
        undecodable_bytes=3,
        connections=(
            ConnectionSeen("1", _NS, _NS + 9, {A2C: 1323, C2A: 72}, 18, "reset", "a:1 → b:8877"),
            ConnectionSeen("2", _NS, _NS, {}, 0, "mislaid"),
        ),
        exchanges=(
            CommandSeen("0x3E", 1, 0, {"unanswered": 1}),
            CommandSeen("run_program", 3, 1, {}, _TIMING, _TIMING),
        ),
        transfers=(
            TransferSeen(
                name="a.rob",
                upload=True,
                begun_ns=_NS,
                duration_ms=305.2,
                size_bytes=1024,
                received_bytes=200,
                chunks=6,
                order="big",
                state="failed",
                reason="cut",
            ),
        ),
        runs=(
            RunSeen(
                name="a.rob",
                simulated=False,
                begun_ns=_NS,
                duration_ms=None,
                outcome="refused",
                code="20",
            ),
            RunSeen(
                name="b.rob",
                simulated=True,
                begun_ns=_NS,
                duration_ms=12.5,
                outcome="odd",
                code="ZZ",
            ),
        ),
        losses=(Loss("1", A2C, 12, -1, _NS, "lost packets"),),
        unlisted={"losses": 3},
    ),
)


@pytest.fixture
def full() -> Results:
    """Return results with every verdict, every list and unknown names."""
    return FULL


@pytest.fixture
def hostile() -> Results:
    """Return the full results with hostile text wherever a SUT or another writer can add some."""
    assert FULL.session
    evidence = replace(_FRAME, connection=HOSTILE, note=HOSTILE, fields=(
        FrameField(HOSTILE, 1, 3, HOSTILE), FrameField("over", 2, 900), FrameField("far", 99, 1),
    ))  # fmt: skip
    cases = tuple(
        replace(
            case,
            id=f"{HOSTILE}{number}",
            requirements=(*case.requirements, HOSTILE),
            message=HOSTILE,
            expected=HOSTILE,
            observed=HOSTILE,
            replay=HOSTILE,
            wire=(evidence, replace(evidence, frame_hex=HOSTILE)),
            step=FailedStep(_NS, Stage.FRAME, HOSTILE, HOSTILE, dependency=HOSTILE),
            operator=(OperatorRequest(HOSTILE, 1, 2, OperatorAnswer.DONE, (HOSTILE,)),),
        )
        for number, case in enumerate(FULL.cases)
    )
    session = FULL.session
    odd = ReadingSeen((HOSTILE,), default=False, mixed=True, claimed=HOSTILE)
    return replace(
        FULL,
        tool=Tool(HOSTILE, HOSTILE),
        subject=Subject(
            Role.CLIENT, HOSTILE, HOSTILE, HOSTILE, HOSTILE, {HOSTILE: HOSTILE}, HOSTILE
        ),
        readings={HOSTILE: {HOSTILE: odd}},
        requirements=(RequirementResult(HOSTILE, Verdict.FAIL, (cases[0].id,)),),
        cases=cases,
        causes=(RootCause(HOSTILE, (HOSTILE,), (HOSTILE,), (HOSTILE,)),),
        session=replace(
            session,
            connections=tuple(replace(c, name=HOSTILE, note=HOSTILE) for c in session.connections),
            exchanges=tuple(replace(e, name=HOSTILE) for e in session.exchanges),
            transfers=tuple(
                replace(t, name=HOSTILE, state=HOSTILE, reason=HOSTILE) for t in session.transfers
            ),
            runs=tuple(
                replace(r, name=HOSTILE, outcome=HOSTILE, code=HOSTILE) for r in session.runs
            ),
            losses=tuple(replace(loss, note=HOSTILE) for loss in session.losses),
        ),
    )


@pytest.fixture
def hostile_text() -> str:
    """Return the text of the hostile results."""
    return HOSTILE


@pytest.fixture(scope="session")
def audited(fixtures_dir: Path) -> Callable[[str], Results]:
    """Return a function that audits a field capture."""

    @cache
    def audit(name: str) -> Results:
        judge, stats = Judge(), SessionStats()
        for event in read_pcap(fixtures_dir / "captures" / "field" / f"{name}.pcapng"):
            for item in judge.feed(event):
                stats.add(item)
        for item in judge.close():
            stats.add(item)
        subject = Subject(Role.CAPTURE, file=f"{name}.pcapng")
        return from_audit(judge, stats, subject=subject, replay=f"scaraspec audit {name}.pcapng")

    return audit
