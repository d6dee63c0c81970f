"""Every text of the page has a translation and is in use."""

from pathlib import Path

from scaraspec.judge.requirements import REQUIREMENTS, Basis, Strength
from scaraspec.judge.verdicts import Cause, Conclusion, Reason, Side, Verdict
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.transfer import TransferState
from scaraspec.report import texts
from scaraspec.report.model import Role
from scaraspec.report.operator_request import OperatorAnswer
from scaraspec.report.texts import CLAUSE_TITLES, TEXTS
from scaraspec.traffic.events import Ending
from scaraspec.traffic.wire import Kind

SETTLED = ("OPEN", "ANSWERED")


def test_every_shown_value_has_a_translation() -> None:
    """A new verdict, cause, hazard or ending is not shown as a bare key."""
    needed = {
        *(c.value for c in Conclusion),
        *(f"{c.value}_means" for c in Conclusion),
        *(v.value for v in Verdict if v is not Verdict.INCONCLUSIVE),
        *(f"cause_{c.value}" for c in Cause),
        *(f"reason_{r.value}" for r in Reason),
        *(f"hazard_{h.value}" for h in Hazard),
        *(r.value for r in Role),
        *(s.value for s in Strength),
        *(b.value for b in Basis),
        *(d.value for d in Direction),
        *(f"state_{s.value}" for s in TransferState),
        *(f"outcome_{e.value}".replace(" ", "-") for e in Ending if e.name not in SETTLED),
        *(f"outcome_{o}" for o in ("done", "failed", "refused", "interrupted")),
        *(f"operator_{a.value}" for a in OperatorAnswer),
        *(f"ending_{k.value}" for k in (Kind.HALF_CLOSED, Kind.CLOSED, Kind.RESET)),
        "ending_open",
    }
    assert needed - TEXTS.keys() == set()


def test_every_clause_has_a_title() -> None:
    """The coverage matrix has no row without a title."""
    assert {r.clause for r in REQUIREMENTS.values()} <= CLAUSE_TITLES.keys()


def test_no_unused_translations() -> None:
    """A text that no template uses is removed from the table."""
    templates = Path(texts.__file__).with_name("templates").glob("*.html")
    reported = "".join(template.read_text(encoding="utf-8") for template in templates)
    prefixes = ("cause_", "reason_", "hazard_", "state_", "outcome_", "ending_", "lane_", "stage_")
    kinds = (Conclusion, Verdict, Role, Side, Strength, Basis, Direction)
    computed = {member.value for kind in kinds for member in kind}
    computed |= {f"{conclusion.value}_means" for conclusion in Conclusion}
    computed |= {f"operator_{answer.value}" for answer in OperatorAnswer}
    computed.add("both")  # the side of a finding about client and controller
    left = [
        key
        for key in TEXTS
        if f'"{key}"' not in reported and key not in computed and not key.startswith(prefixes)
    ]
    assert left == []
