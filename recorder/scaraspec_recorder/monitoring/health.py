"""Health of the recorder that writes into a folder, from its files; no process is contacted."""

import time
from collections.abc import Callable
from pathlib import Path

from scaraspec.user_message import UserMessage
from scaraspec_recorder.monitoring.status import STALL_S
from scaraspec_recorder.recordings.upload_log import UploadState
from scaraspec_recorder.sinks.sink_runner import Progress
from scaraspec_recorder.spool.locks import find_spool
from scaraspec_recorder.spool.spool import (
    checkpoint_time_s,
    read_checkpoint,
    stall_of,
    unread_bytes,
)


def health_problems(out_dir: Path, now_s: Callable[[], float] = time.time) -> list[str]:
    """Return why the recorder of a folder does not record or upload now; empty if it does.

    Earlier gaps, and a robot that cannot be reached, are no problem of the recorder.
    """
    spool = find_spool(out_dir)
    written_s = checkpoint_time_s(spool) if spool else None
    if spool is None or written_s is None:
        return [UserMessage("no recorder writes into {out_dir}", out_dir=out_dir)]
    checkpoint = read_checkpoint(spool)
    problems = list(Progress.read(checkpoint.get("state", {})).problems)
    silent_s = now_s() - written_s
    if stall := stall_of(checkpoint):
        problems.append(UserMessage("writing is stalled: {reason}", reason=stall.reason))
    elif silent_s > STALL_S:
        waiting = UserMessage("{count} bytes wait", count=unread_bytes(spool))
        problems.append(
            UserMessage(
                "nothing was written for {silent_s:.0f} s, {waiting}",
                silent_s=silent_s,
                waiting=waiting,
            )
        )
    if (uploads := UploadState.read(spool)) and (problem := uploads.problem(int(now_s() * 1e9))):
        problems.append(problem)
    return problems
