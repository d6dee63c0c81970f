"""What a user can get wrong, as one sentence and an exit status."""

from scaraspec.judgement.verdicts import ExitStatus


class Problem(Exception):  # noqa: N818 - it is told to a user, who made no error in Python
    """One sentence for the user: what was wrong, where, what to do."""

    def __init__(self, sentence: str, exit_status: ExitStatus = ExitStatus.USAGE) -> None:
        super().__init__(sentence)
        self.exit_status = exit_status
