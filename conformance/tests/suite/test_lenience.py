"""Controllers that do what the document leaves open, other than the virtual one, are not failed."""

import math
import struct
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from scaraspec.cli.proving_controller import PASSWORD, Robot, hooks_of
from scaraspec.controller.behaviour import SILENCE
from scaraspec.controller.behaviour.base import ACCEPTED, Silence, refused
from scaraspec.controller.brain import Brain
from scaraspec.controller.plant import Plant
from scaraspec.controller.robot import DONE
from scaraspec.controller.session import Action, Carrier, Close, Request, Session
from scaraspec.controller.store import Store
from scaraspec.judgement.verdicts import Verdict
from scaraspec.protocol.commands import Network, RunningProgram
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, Skipped, Why
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.report.model import Case
from scaraspec.suite.as_client.access import MemoryAccess
from scaraspec.suite.as_client.setting import ControllerSetting
from scaraspec.suite.plan import ALL, Options
from scaraspec.suite.run import Run
from scaraspec.suite.statement import Statement

_STATE = frozenset({Hazard.READ_ONLY, Hazard.STATE})
GOOD = (Verdict.PASS, Verdict.TOLERATED)


def tried(
    brain: type[Brain], *only: str, spoken: Dialect | None = None, **claims: Any
) -> Mapping[str, Case]:
    """What comes of the cases of these requirements; where not said, what is spoken is claimed."""
    robot = Robot(brain, spoken or claims.get("dialect", DEFAULT))
    options = Options(only=frozenset(only), allowed=ALL, examples=5)
    access = MemoryAccess(robot.network)
    results = Run(ControllerSetting(access, Statement(**claims), PASSWORD, options)).results()
    return {case.id: case for case in results.cases}


def wrong(cases: Mapping[str, Case]) -> list[str]:
    """The cases that neither passed nor were tolerated."""
    return [f"{case.id}: {case.message}" for case in cases.values() if case.verdict not in GOOD]


def wrong_but_not_run(cases: Mapping[str, Case]) -> list[str]:
    """The cases that were run, and neither passed nor were tolerated."""
    return wrong({key: case for key, case in cases.items() if case.verdict is not Verdict.NONE})


class RestartHook:
    """Takes the settings over that a restart would."""

    brain: "AppliesLater"

    def run(self, **_: object) -> None:
        """Do it."""
        self.brain.apply()


class AppliesLater(Brain):
    """A new network is told once the robot was restarted."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        RestartHook.brain = self
        self.apply()

    def apply(self) -> None:
        """Restart."""
        settings = self.store.settings
        self._told = Network(settings.ip, settings.mask, settings.gateway)

    def get_network(self, _: Request) -> Network:
        """Tell the former one."""
        return self._told


class CutsALittleLater(Brain):
    """A new network is answered, and the connection ends while the next is asked."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._doomed: set[int] = set()

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """End it."""
        if session.connection in self._doomed:
            self._end(session, now_s)
            return
        super().handle(session, frame, now_s)
        if frame.opcode == 0x05:
            self._doomed.add(session.connection)


class CutsBehindTheReply(Brain):
    """A new network is answered, and then the connection ends."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """End it."""
        super().handle(session, frame, now_s)
        if frame.opcode == 0x05 and self._value(self._command(frame), frame) is not None:  # type: ignore[arg-type] # it has a row
            self._end(session, now_s)


class ClosesOnMalformed(Brain):
    """A request that says nothing usable ends its connection."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """End it."""
        command = self._command(frame)
        asks = command and command.request.fields and not command.two_stage
        if command and asks and command.asker is A2C and self._value(command, frame) is None:
            self._end(session, now_s)
        else:
            super().handle(session, frame, now_s)


class ClosesOnAnyMalformed(Brain):
    """As before, and commands that move the arm are no exception."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """End it."""
        command = self._command(frame)
        spoilt = command and frame.data and self._value(command, frame) is None
        if command and spoilt and command.asker is A2C:
            self._end(session, now_s)
        else:
            super().handle(session, frame, now_s)


class IgnoresMalformed(Brain):
    """A request that says nothing usable is not answered."""

    def _reply(self, session: Session, command: Any, frame: Frame, answer: Any) -> None:
        if command.request.fields and self._value(command, frame) is None:
            answer = SILENCE
        super()._reply(session, command, frame, answer)


class OverlooksEnds(Brain):
    """The byte behind the data of a frame is taken for its end, whatever it is."""

    def _take_in(self, session: Session, found: list[Any], now_s: float) -> None:
        for index, item in enumerate(found):
            if isinstance(item, Skipped) and item.why is Why.BAD_END:
                found[index] = Frame(A2C, item.data[1], item.data[3:-1])
        super()._take_in(session, found, now_s)


class HasRulesForPasswords(Brain):
    """A password has six to sixteen letters and digits."""

    def set_password(self, request: Request) -> bool:
        """Hold it against them."""
        new = request.value.new
        return 6 <= len(new) <= 16 and new.isalnum() and super().set_password(request)


class ServesTwo(Brain):
    """More clients than two are refused (A-2-2)."""

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Refuse them."""
        most = 2
        full = len(self.sessions) == most
        return [Close(connection)] if full else super().open(connection, now_s, link)


class RefusesFurtherLogins(Brain):
    """While one client is logged in the password opens to no other one (A-2-2)."""

    def login(self, request: Request) -> bool:
        """Refuse it."""
        others = [each for each in self.sessions.values() if each is not request.session]
        return not any(each.logged_in for each in others) and super().login(request)


class AnswersZeroToStrangers(Brain):
    """Whatever comes before the login is answered 0 (A-4-4)."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Answer it."""
        if session.logged_in or frame.opcode == 0x01:
            super().handle(session, frame, now_s)
        else:
            self.emit(session, Frame(C2A, frame.opcode, b"0"))


class EndsWithABar(Brain):
    """Every field of what runs and where the arm is ends with a bar (A-T-4)."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Add it."""
        if frame.opcode in (0x0A, 0x3C) and b"|" in frame.data:
            frame = Frame(C2A, frame.opcode, frame.data + b"|")
        super().emit(session, frame)


class EndsWithANul(Brain):
    """Every text ends with a NUL, also one of no character (A-T-3)."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Add it."""
        if frame.opcode in (0x08, 0x0B, 0x0D, 0x13):
            frame = Frame(C2A, frame.opcode, frame.data + b"\0")
        super().emit(session, frame)


class HasALongDefault(Brain):
    """The default program that it came with has a name of 40 bytes (A-4.9-5)."""

    name = b"delivered-with-the-robot-in-the-year.rob"
    has: Store

    def __init__(self, plant: Plant, store: Store, dialect: Dialect) -> None:
        if self.name not in store:
            store.write(self.name, b"SCARA")
            store.save(replace(store.settings, default_program=self.name))
        HasALongDefault.has = store
        super().__init__(plant, store, dialect.replace(name_max="255"))


class EndsJustThen(Brain):
    """A reset ends when another client asks for a release, and its result goes to the first."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """End it."""
        task = self.robot.task
        if frame.opcode == 0x3A and task and task.state == "03" and task.request.session != session:
            self.robot.stop(now_s)
            self.conclude(task.request, DONE)
            self._send_later()
        super().handle(session, frame, now_s)


class BigChunks(Brain):
    """The numbers of a chunk are big-endian, as a network's are; those of a program are not."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Take no other."""
        return request.frame.data[8:11] == bytes(3) and super().upload_chunk(request)

    def emit(self, session: Session, frame: Frame) -> None:
        """Send no other."""
        if frame.opcode == 0x56:
            head = b"".join(frame.data[at : at + 4][::-1] for at in (0, 4, 8))
            frame = frame._replace(data=head + frame.data[12:])
        super().emit(session, frame)

    def is_program(self, name: bytes) -> bool:
        """Whether it is listed: as a little-endian program of the usual layout only."""
        content = self.store.read(name) if name in self.store else b""
        nodes, variables = struct.unpack_from("<8xII", content) if len(content) > 16 else (0, 0)
        return name in self.store and len(content) == 97 + 64 * nodes + 28 * variables

    def run_program(self, request: Request) -> Acceptance | Silence:
        """Run no other."""
        name = request.value
        if self.robot.task is None and name in self.store and not self.is_program(name):
            return refused("20")
        return super().run_program(request)


class FindsOutLate(Brain):
    """That a program is missing is found out late (A-4.15-1), and meanwhile nothing else is
    answered that would execute (A-4-2)."""

    due_s = math.inf

    def run_program(self, request: Request) -> Acceptance | Silence:
        """Look for it later."""
        return self._later_missing(request, super().run_program(request))

    def simulate_program(self, request: Request) -> Acceptance | Silence:
        """Look for it later."""
        return self._later_missing(request, super().simulate_program(request))

    def _later_missing(self, request: Request, answer: Acceptance | Silence) -> Any:
        if self.due_s < math.inf:
            return SILENCE
        if isinstance(answer, Acceptance) and answer.code == "20":
            self.due_s, self._asked = request.now_s + 0.05, request
            return ACCEPTED
        return answer

    def _elapse(self, now_s: float) -> None:
        super()._elapse(now_s)
        if self.due_s <= now_s:
            self.due_s = math.inf
            self.conclude(self._asked, Outcome(done=False, code="20"))
            self._send_later()

    @property
    def next_event_s(self) -> float | None:
        """When it is found out."""
        due_s = min(self.due_s, super().next_event_s or math.inf)
        return None if due_s == math.inf else due_s


class KeepsSingles(Brain):
    """Numbers are kept in 32 bits, and printed with six decimals (A-T-5)."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Print them."""
        if frame.opcode in (0x34, 0x37):
            numbers = map(float, frame.data.split(b"|"))
            singles = struct.unpack("6f", struct.pack("6f", *[*numbers, 0.0, 0.0, 0.0][:6]))
            count = 1 + frame.data.count(b"|")
            frame = Frame(C2A, frame.opcode, b"|".join(b"%f" % n for n in singles[:count]))
        super().emit(session, frame)


class LocksOut(Brain):
    """Two wrong passwords in a row, and nobody gets in any more (A-4.1-2)."""

    _row = 0

    def login(self, request: Request) -> bool:
        """Count them."""
        right = self._row < 2 and super().login(request)
        self._row = 0 if right else self._row + 1
        return right

    def set_password(self, request: Request) -> bool:
        """Here, too."""
        changed = super().set_password(request)
        self._row += not changed
        return changed


class Greets(Brain):
    """Every connection begins with the version (A-3-16)."""

    def _admit(self, connection: int, carrier: Carrier) -> None:
        super()._admit(connection, carrier)
        self.emit(self.sessions[connection], Frame(C2A, 0x08, b"1.0.0"))


class KeepsItsDefault(Brain):
    """The default program is not deleted (A-4.11-1)."""

    def delete_program(self, request: Request) -> bool:
        """Keep it."""
        kept = request.value == self.store.settings.default_program
        return not kept and super().delete_program(request)


class DisplacesAMomentLater(Brain):
    """The newest client is served; a moment later the one before is sent away (A-2-2)."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._due_s: dict[int, float] = {}

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Remember whom to send away."""
        for other in self.sessions:
            self._due_s.setdefault(other, now_s + 0.05)
        return super().open(connection, now_s, link)

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Serve only the newest."""
        return super().receive(connection, b"" if connection in self._due_s else data, now_s)

    def _elapse(self, now_s: float) -> None:
        super()._elapse(now_s)
        for connection in [c for c, due_s in self._due_s.items() if due_s <= now_s]:
            del self._due_s[connection]
            if connection in self.sessions:
                self._end(self.sessions[connection], now_s)

    @property
    def next_event_s(self) -> float | None:
        """When the next one is sent away."""
        return min((*self._due_s.values(), super().next_event_s or math.inf), default=None)


class GoesSlowly(Brain):
    """Shut down, it ends its connections at once, and itself half a second later (A-4.35-2)."""

    gone_s = math.inf

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Remember when it will be gone."""
        super().handle(session, frame, now_s)
        if not self.powered and self.gone_s == math.inf:
            self.gone_s = now_s + 0.5

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Serve whoever comes in between."""
        self.powered = now_s < self.gone_s
        return super().open(connection, now_s, link)


class FailsLate(Brain):
    """A motor fails, and the final result takes a while (A-3-15)."""

    _due_s: float | None = None

    def _settle(self, now_s: float) -> None:
        if self.robot.task is None or self.plant.fault_code is None:
            super()._settle(now_s)
            return
        self._due_s = now_s + 1 if self._due_s is None else self._due_s
        if now_s >= self._due_s:
            self._due_s = None
            super()._settle(now_s)

    @property
    def next_event_s(self) -> float | None:
        """When the result is due."""
        return super().next_event_s if self._due_s is None else self._due_s


class SimulatesAtOnce(Brain):
    """A simulation takes no time."""

    def simulate_program(self, request: Request) -> Acceptance:
        """End it."""
        answer = super().simulate_program(request)
        if answer.accepted:
            self.robot.stop(request.now_s)
            self.conclude(request, DONE)
        return answer


class ServesNothingMeanwhile(Brain):
    """While a command executes only the emergency stop is served; the rest waits (A-4-3)."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._waiting: list[tuple[Session, Frame]] = []

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Let it wait."""
        if self.robot.task is not None and frame.opcode != 0x32:
            self._waiting.append((session, frame))
        else:
            super().handle(session, frame, now_s)

    def _settle(self, now_s: float) -> None:
        super()._settle(now_s)
        while self.robot.task is None and self._waiting:
            self.handle(*self._waiting.pop(0), now_s)


def test_a_wrong_end_byte_may_be_overlooked_and_is_warned_of() -> None:
    """What follows a frame in place of its end byte is open (A-3-10)."""
    framewise = DEFAULT.replace(resync="framewise")
    cases = tried(OverlooksEnds, "3/20", dialect=framewise)
    assert not wrong(cases)
    assert cases["3/20.end"].verdict is Verdict.TOLERATED


@pytest.mark.parametrize(
    ("served", "claimed", "right"),
    [("both", "both", True), ("both", "0x0D", True), ("both", "0x13", False)]
    + [("0x13", claimed, claimed == "0x13") for claimed in ("both", "0x0D", "0x13")],
)
def test_a_claim_of_opcodes_is_wrong_where_others_are_found(
    served: str, claimed: str, *, right: bool
) -> None:
    """A robot that is silent shows none until a program is the default one (A-4.12-2)."""
    spoken = DEFAULT.replace(op_get_default=served, default_none="silence")
    claims = {"dialect": spoken.replace(op_get_default=claimed), "claimed": {"op_get_default"}}
    assert not tried(Brain, "2/7", spoken=spoken, **claims)
    cases = tried(Brain, "4.12/5", spoken=spoken, **claims)
    assert ("claim.op_get_default" not in cases) is right


@pytest.mark.parametrize("only", ["2/12", "3/18", "3/20", "4/6", "4.28/5"])
def test_who_is_displaced_may_be_sent_away_a_moment_later(only: str) -> None:
    """That the newest client wins is found out although the one before is not gone at once."""
    assert not wrong_but_not_run(tried(DisplacesAMomentLater, only))


def test_no_default_program_may_be_told_as_a_nul() -> None:
    """It is an empty text, which some end as they do any other (A-4.12-2, A-T-3)."""
    assert not wrong_but_not_run(tried(EndsWithANul, "4.12/4", "4.12/3", "4.13/5"))


def test_a_default_program_of_a_long_name_is_put_back() -> None:
    """By the bytes that were told: names of 30 bytes are what is sent of one's own."""
    assert not wrong(tried(HasALongDefault, "4.13/3"))
    assert HasALongDefault.has.settings.default_program == HasALongDefault.name


def test_who_is_free_again_may_accept_what_another_client_asks() -> None:
    """Which of two connections was served first is not seen where both are within a moment."""
    cases = tried(EndsJustThen, "4/6")
    assert cases["4/6.reset"].verdict is Verdict.NONE
    assert all(cases[f"4/6.{name}"].verdict is Verdict.PASS for name in ("jog", "run_program"))


def test_chunks_and_programs_may_differ_in_their_byte_order() -> None:
    """Each is a point that is open by itself (A-5-2, A-6.1-4)."""
    cases = tried(BigChunks, "4.8/4", "4.9/2", "4.10/11", "4.11/3", "5.2/12", "6.5/26")
    assert not wrong_but_not_run(cases)


@pytest.mark.parametrize("only", ["8/2", "T/1", "T/7"])
def test_what_is_missing_may_be_found_out_late_by_a_robot_that_is_then_silent(only: str) -> None:
    """What was accepted is waited for before the next is asked."""
    assert not wrong_but_not_run(tried(FindsOutLate, only))


def test_a_robot_that_serves_a_last_client_while_it_goes_has_not_returned() -> None:
    """Nothing needs to be put back: it was, before the shutdown."""
    cases = tried(GoesSlowly, "4.35/2")
    assert not wrong(cases)
    assert cases["4.35/2"].verdict is Verdict.TOLERATED


def test_silence_while_busy_is_claimed_rightly_though_a_reset_is_refused() -> None:
    """The refusal of a reset is drawn (L397), the others are not: the claim is of those."""
    silent = DEFAULT.replace(busy_reply="silence")
    for only in ("3/31", "4.18/2", "4.28/4"):
        assert not wrong(tried(Brain, only, dialect=silent, claimed=frozenset({"busy_reply"})))


def test_an_opcode_that_may_be_unknown_proves_no_claim() -> None:
    """Without a default program the other opcode is answered 0, as an undefined one is (A-3-9)."""
    silent = DEFAULT.replace(on_unknown="0", op_get_default="0x13", default_none="silence")
    cases = tried(Brain, "2/7", dialect=silent, claimed=frozenset(silent.differences()))
    assert not wrong(cases)


def test_a_network_that_applies_after_a_restart_is_read_back_then() -> None:
    """The claim is believed, and verified with the hook."""
    hooks = {"restart": RestartHook()}
    cases = tried(AppliesLater, "4.4/4", network_applies="after-restart", hooks=hooks)
    assert not wrong(cases)


def test_a_network_that_applies_after_a_restart_cannot_be_verified_without_one() -> None:
    """Nothing is said of it then."""
    cases = tried(AppliesLater, "4.4/4", network_applies="after-restart")
    assert {case.verdict for case in cases.values()} == {Verdict.NONE}


@pytest.mark.parametrize(
    ("key", "option", "requirement"),
    [
        ("text_encoding", "utf-8", "T/8"),  # which refuses names that are none
        ("empty_file", "name-only", "5.4/7"),  # which leaves one of an upload without a chunk
        ("busy_reply", "queue", "4.28/4"),  # which is silent at first
    ],
)
def test_a_claim_is_held_against_nothing_else(key: str, option: str, requirement: str) -> None:
    """What a case makes of a refusal, or of a file that is left, contradicts no claim."""
    spoken = DEFAULT.replace(**{key: option})
    claimed = frozenset({key, "partial_keep"})
    made = tried(Brain, requirement, spoken=spoken, dialect=spoken, claimed=claimed)
    assert not [case for case in made if case.startswith("claim.")]


@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
def test_what_names_may_be_written_in_is_told(encoding: str) -> None:
    """Of the names refused some are no text in the encoding that is taken (A-T-2)."""
    case = tried(Brain, "T/8", spoken=DEFAULT.replace(text_encoding=encoding))["T/8"]
    assert case.verdict is Verdict.TOLERATED
    assert case.observed == f"text_encoding = {encoding}"


def test_a_claim_is_held_against_silence() -> None:
    """Who claims to refuse while it is busy, and is silent, has made a wrong claim."""
    claims = {"dialect": DEFAULT, "claimed": frozenset({"busy_reply"})}
    silent = DEFAULT.replace(busy_reply="silence")
    assert tried(Brain, "4/6", spoken=silent, **claims)["claim.busy_reply"].verdict is Verdict.FAIL
    assert "claim.busy_reply" not in tried(Brain, "4/6", **claims)


def test_a_network_that_applies_late_unclaimed_is_a_failure() -> None:
    """What is not claimed is judged by the default."""
    assert tried(AppliesLater, "4.4/4")["4.4/4"].verdict is Verdict.FAIL


@pytest.mark.parametrize(
    ("brain", "only"),
    [
        (CutsBehindTheReply, ("4.4/2", "4.4/4", "4.4/5")),
        (CutsALittleLater, ("4.4/4",)),
        (ClosesOnMalformed, ("4.4/5", "4.5/5", "4.11/4", "4.13/5", "4.20/4", "4.21/4")),
        (RefusesFurtherLogins, ("2/12",)),
        (Greets, ("2/12", "3/29", "5.3/4")),
        (LocksOut, ("4.1/2", "4.2/3", "4.2/6")),
        (KeepsSingles, ("4.20/3", "4.21/3")),
        (AnswersZeroToStrangers, ("2/11",)),
        (EndsWithABar, ("4.9/2", "4.27/2")),
        (ClosesOnAnyMalformed, ("3/17", "4.24/3", "4.28/7", "4.32/5", "4.32/7", "5.2/15")),
        (IgnoresMalformed, ("4.4/5", "4.5/5", "4.11/4", "4.13/5", "4.20/4", "4.21/4")),
    ],
)
def test_what_is_open_is_not_failed(brain: type[Brain], only: tuple[str, ...]) -> None:
    """Every case of these requirements passes or is tolerated."""
    assert not wrong(tried(brain, *only))


def test_a_few_clients_are_enough() -> None:
    """How many clients are served at once is open (A-2-2)."""
    assert not wrong(tried(ServesTwo, "3/29", "3/32"))


class NoticesLate(Brain):
    """Of one client it notices a moment late that it has gone, and serves no other till then."""

    _left_s = -math.inf

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Look who is there."""
        if now_s > self._left_s + 0.05:
            return super().open(connection, now_s, link)
        self._actions.append(Close(connection))
        return self._taken()

    def close(self, connection: int, now_s: float) -> list[Action]:
        """Remember when."""
        if connection in self.sessions:
            self._left_s = now_s
        return super().close(connection, now_s)


def test_who_notices_late_that_a_client_has_gone() -> None:
    """The next client of a robot that serves one may have to come twice, from the beginning on."""
    cases = tried(NoticesLate, "4.7/2", spoken=DEFAULT.replace(max_clients="one"))
    assert cases
    assert not wrong(cases)


def test_a_default_program_that_stays_is_nobodys_fault() -> None:
    """What the suite has made the default program need not go any more (A-4.11-1)."""
    assert not wrong(tried(KeepsItsDefault, "4.13/3"))


def test_a_fault_may_show_before_the_result() -> None:
    """A status that tells of a fault does not say that nothing executes (A-4.8-2)."""
    robot = Robot(FailsLate, DEFAULT)
    options = Options(only=frozenset({"4/3"}), allowed=ALL, examples=1)
    statement = Statement(hooks=hooks_of(robot))
    setting = ControllerSetting(MemoryAccess(robot.network), statement, PASSWORD, options)
    cases = {case.id: case for case in Run(setting).results().cases}
    assert cases["4/3.fault"].verdict is Verdict.PASS
    assert not wrong(cases)


def test_odd_passwords_may_be_refused() -> None:
    """How long a password may be, and of what, is open (A-4.1-3)."""
    cases = tried(HasRulesForPasswords, "4.2/3", "4.2/4", "4.2/6")
    assert not wrong(cases)
    assert cases["4.2/4"].verdict is Verdict.TOLERATED


@pytest.mark.parametrize("brain", [SimulatesAtOnce, ServesNothingMeanwhile])
def test_who_cannot_be_asked_while_executing_is_not_failed(brain: type[Brain]) -> None:
    """What cannot be seen so is not tried (A-4-3)."""
    cases = tried(brain, "4.8/4", "4.8/5", "4.9/2", "4.9/3", "4.9/4")
    assert Verdict.FAIL not in {case.verdict for case in cases.values()}


class WasNeverSetUp(Brain):
    """Its initial position is six zeros, and its default program is not stored: it refuses both."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.save(initial_tool_position=(0.0,) * 6, default_program=b"gone.rob")

    def get_default_program(self, _: Request) -> bytes:
        """Tell it all the same."""
        return self.store.settings.default_program


def test_what_nobody_can_put_back() -> None:
    """What the subject refuses to take back even at first leaves no run inconclusive."""
    cases = tried(WasNeverSetUp, "4.13/3", "4.21/3", "4.13/2")
    assert not wrong(cases)


class HearsNothingButTheStopWhileItJogs(Brain):
    """While it jogs only the emergency stop is served (A-4-3)."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Be deaf."""
        task = self.robot.task
        if task is None or task.request.command.name != "jog" or frame.opcode == 0x32:
            super().handle(session, frame, now_s)


def test_deaf_while_it_jogs() -> None:
    """Who serves queries during programs and none during a jog is failed by nothing."""
    cases = tried(
        HearsNothingButTheStopWhileItJogs, "4.8/7", "4.25/5", "4.28/3", "4.28/4", "4.28/5", "4/6"
    )
    skipped = [case.id for case in cases.values() if case.verdict is Verdict.NONE]
    assert "4.8/7.jogging" in skipped
    assert all(case.verdict in (*GOOD, Verdict.NONE) for case in cases.values()), wrong(cases)


class RunsForOthers(Brain):
    """Somebody else's program runs on it for ever."""

    name = b"welding.rob"

    def get_status(self, _: Request) -> str:
        """Say so."""
        return "01"

    def get_running_program(self, request: Request) -> RunningProgram | None:
        """Tell which."""
        return RunningProgram(self.name, int(request.now_s)) if self.name else None

    def set_gripper_center(self, _: Request) -> bool:
        """Refuse it meanwhile (A-4.20-1)."""
        return False


class LeavesOursRunning(RunsForOthers):
    """What it says to run is the suite's."""

    name = b"zs1.rob"


class SaysThatItRuns(RunsForOthers):
    """Nothing is told to run."""

    name = b""


def _found_busy(brain: type[Brain]) -> Mapping[str, Case]:
    only = frozenset({"3/31", "4.8/3", "4.9/6", "4.20/4"})
    options = Options(only=only, allowed=_STATE, examples=2)
    access = MemoryAccess(Robot(brain, DEFAULT).network)
    results = Run(ControllerSetting(access, Statement(), PASSWORD, options)).results()
    return {case.id: case for case in results.cases if "--allow" not in case.message}


def test_a_robot_at_work_is_not_failed_for_it() -> None:
    """Who asks a robot that others run may find it busy; it is not said to be idle either."""
    cases = _found_busy(RunsForOthers)
    skipped = {case.id for case in cases.values() if "welding.rob" in case.message}
    sequences = {"3/31.sequences", "3/31.long-use", "4.20/3.sequences"}
    assert skipped == {"4.8/2", "4.9/6", "4.20/4", *sequences}
    assert all(case.verdict in (*GOOD, Verdict.NONE) for case in cases.values()), wrong(cases)


@pytest.mark.parametrize("brain", [LeavesOursRunning, SaysThatItRuns])
def test_what_does_not_look_like_work_is_failed(brain: type[Brain]) -> None:
    """A status alone is no program, and a program of the suite's own no work of others."""
    assert _found_busy(brain)["4.8/2"].verdict is Verdict.FAIL
