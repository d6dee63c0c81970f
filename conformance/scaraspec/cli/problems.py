"""What a user can get wrong, as one sentence and an exit status."""

from pathlib import Path

from scaraspec.judgement.verdicts import ExitStatus


class Problem(Exception):  # noqa: N818 - it is told to a user, who made no error in Python
    """One sentence for the user: what was wrong, where, what to do."""

    def __init__(self, sentence: str, exit_status: ExitStatus = ExitStatus.USAGE) -> None:
        super().__init__(sentence)
        self.exit_status = exit_status


def make_folder(path: Path) -> None:
    """Make a folder to write into; a disk that is full or failing may serve later.

    Raises:
        Problem: It can never be one.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise Problem(f"{path} is no folder: name another with --out") from None
    except (FileNotFoundError, PermissionError) as error:
        raise Problem(f"the folder {path} cannot be made: {error.strerror}") from None
    except OSError:
        pass
