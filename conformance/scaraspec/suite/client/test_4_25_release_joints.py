"""4.25: releasing the joints (0x3A, L518-549)."""

from scaraspec.suite.as_controller.executing import failed, finished
from scaraspec.suite.as_controller.line import Line
from scaraspec.suite.as_controller.subject import Subject
from scaraspec.suite.case import client_case
from scaraspec.suite.examples import examples


@client_case("4.25/1", attended=True)
def test_release(subject: Subject, line: Line) -> None:
    """The joints are released; once that fails."""
    for code in examples(("", "12")):
        call = subject.begin("release_joints")
        line.serve(call, data=b"1", sent=b"")
        line.result("release_joints", code)
        if code:
            failed(subject, call)
        else:
            finished(subject, call)
