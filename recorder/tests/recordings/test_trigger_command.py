"""The command of a trigger: it gets the facts, and never delays the recording."""

import shlex
import sys
from pathlib import Path

import pytest

from scaraspec_recorder.recordings import trigger_command
from scaraspec_recorder.recordings.trigger_command import (
    MOST_WAITING,
    TriggerCommand,
    parse_command,
)

WRITE = "import os, pathlib; pathlib.Path({!r}).open('a').write('{}'.format_map(os.environ))"
FACTS = "{SCARASPEC_ROBOT} {SCARASPEC_TRIGGER} {SCARASPEC_REASON} {SCARASPEC_TIME} {SCARASPEC_FILE}"
CAPTURE = Path("captures/a.mcap")


def command(*words: str) -> TriggerCommand:
    return TriggerCommand(words, "line-3", lambda: CAPTURE, interval_s=0)


def test_the_facts_of_a_trigger(tmp_path: Path) -> None:
    """They are environment variables; text from the link is no part of the command."""
    output = tmp_path / "output"
    script = WRITE.format(str(output), FACTS)
    ran = command(*parse_command(shlex.join([sys.executable, "-S", "-c", script])))
    ran.run("refusal", "stop: '; rm -rf /\0", 1_795_215_517 * 10**9)
    ran.close()
    assert output.read_text() == f"line-3 refusal stop: '; rm -rf / 2026-11-20T22:58:37Z {CAPTURE}"


def test_a_failure_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    """The next command still runs."""
    failing = command(sys.executable, "-S", "-c", "raise SystemExit(7)")
    failing.run("gap", "", 1)
    failing.run("late:1s", "", 1)
    failing.close()
    assert [line.partition(":")[0] for line in caplog.messages] == [
        "the command of the trigger gap failed",
        "the command of the trigger late",
    ]
    assert "exit status 7" in caplog.text


def test_a_slow_command_is_killed(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The others that wait are limited, and the caller waits for none."""
    monkeypatch.setattr(trigger_command, "TIMEOUT_S", 0.05)
    slow = command("sleep", "60")
    for _ in range(MOST_WAITING + 5):
        slow.run("refusal", "", 1)
    assert slow._dropped >= 4
    slow._worker.join(0.5)
    slow.run("gap", "", 1)
    assert "timed out after 0.0" in caplog.text
    assert "the command of a trigger was not run" in caplog.text


@pytest.mark.parametrize("text", ["", "/no/such/program now", "'"])
def test_a_command_that_cannot_run(text: str) -> None:
    """It is refused at the start."""
    with pytest.raises(ValueError, match=r"no such program|No closing quotation"):
        parse_command(text)
