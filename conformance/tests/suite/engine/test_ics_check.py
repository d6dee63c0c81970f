"""Proforma and check of an ICS."""

import re
import sys
import tomllib

import pytest

from scaraspec.protocol.readings import READINGS
from scaraspec.suite.engine.hooks import HOOKS
from scaraspec.suite.engine.ics import LABORATORY, SAMPLE, Ics
from scaraspec.suite.engine.ics_check import problems_of
from scaraspec.suite.engine.ics_proforma import Answers, proforma

_UNANSWERED = re.compile(r"^# (\w+ = )", re.MULTILINE)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "[subject]\nlacks = ['jog']\n[readings]\njog_byte = 'ascii'",
            "readings.jog_byte is claimed, but subject.lacks names jog",
        ),
        (
            "[subject]\nlacks = ['upload_name']",
            "subject.lacks names upload_name, but not upload_chunk",
        ),
        (
            "[subject]\nlacks = ['set_network']\nnetwork_applies = 'at-once'",
            "subject.network_applies is stated, but",
        ),
        ("[subject]\nurl = 'x://y'", "subject.url: "),
        (
            "[subject]\nurl = 'tcp://robot'\nlacks = ['login']",
            "subject.lacks names login, but subject.url is a TCP link",
        ),
        (
            "[subject]\nurl = 'serial:///dev/ttyUSB0'\n[readings]\nprelogin = 'ignore'",
            "readings.prelogin is claimed, but subject.url has no login",
        ),
        (
            "[readings]\nname_max = '255'\ntrailing_nul = 'yes'",
            "readings.name_max = 255 and readings.trailing_nul = yes exclude each other",
        ),
        (
            f"[hooks]\ndisk_full = '{sys.executable}'",
            "hooks.disk_full is given without hooks.disk_free",
        ),
        (
            "[motion]\nstep_mm = 5\nbox_mm = [[0, 1], [0, 1], [0, 1]]",
            "motion.step_mm = 5 is longer than every side",
        ),
    ],
)
def test_contradictions(text: str, message: str) -> None:
    """Each contradiction has one sentence."""
    (problem,) = problems_of(tomllib.loads(text))
    assert problem.startswith(message)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[subject]\nlacks = ['get_tool_coordinates']\n[readings]\npose_point = 'gripper'",
        "[subject]\nlacks = ['upload_name', 'upload_chunk']\n[readings]\nendian = 'big'",
        "[subject]\nurl = 'serial:///dev/ttyUSB0'\nlacks = ['login']",
        "[readings]\nname_max = '255'\ntrailing_nul = 'no'",
    ],
)
def test_no_contradiction(text: str) -> None:
    """An ICS without contradictions is accepted."""
    assert problems_of(tomllib.loads(text)) == []


def test_proforma_has_every_question() -> None:
    """Each question has a line, and the default answers give a valid ICS."""
    document = tomllib.loads(_UNANSWERED.sub(r"\1", proforma()))
    assert document["readings"].keys() == READINGS.keys()
    assert document["hooks"].keys() == HOOKS.keys() | {"timeout_s"}
    assert (*document["sample"], *document["laboratory"]) == (*SAMPLE, *LABORATORY)
    del document["hooks"]  # an empty command cannot be started
    assert Ics.of(document).dialect == Ics().dialect


def test_answers_are_filled_in() -> None:
    """An option that was observed alone is claimed; hostile text stays a string."""
    text = proforma(
        Answers(
            "tcp://robot",
            0,
            '1"\n[hooks]\u202e',
            {"endian": ("big",), "jog_byte": ("ascii", "binary")},
            ["get_time"],
        )
    )
    ics = Ics.of(tomllib.loads(text))
    assert (ics.url, ics.version) == ("tcp://robot", '1" [hooks]⟨U+202E⟩')
    assert ics.claimed == {"endian"}
    assert "# Observed were ascii and binary." in text
    assert "# No reply was seen to get_time: name in lacks" in text
    assert "at 1970-01-01T00:00:00+00:00" in text
