"""Steps that upload, download, list and delete files, and set the default program."""

from contextlib import suppress

from scaraspec.protocol.fields import show
from scaraspec.protocol.transfer import chunks_of
from scaraspec.suite.controller.harness.model.state import ENDLESS, ModelState, Step
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import download, send_chunk
from scaraspec.suite.controller.harness.state.defaults import expect_default
from scaraspec.suite.engine.expectations import CaseFailed, expect
from scaraspec.suite.program_files.layout import configured, layout_in_use
from scaraspec.suite.program_files.listed import program_names
from scaraspec.suite.program_files.writing import endless_program, program_file, wait
from scaraspec.user_message import UserMessage


class FileSteps(ModelState):
    """Transfers, lists and deletes files."""

    def _content(self, line: OutgoingConnection, value: int) -> bytes:
        """Programs that do nothing, of several sizes, and one that does not end."""
        dialect, layout = self._subject.dialect, layout_in_use(self._subject)
        base = configured(self._subject, line)
        if value >= ENDLESS:
            return endless_program(dialect, layout=layout, base=base)
        return program_file(dialect, wait(0) * (1 + 2 * value), layout=layout, base=base)

    def _upload(self, step: Step, line: OutgoingConnection) -> str | None:
        name, content = self._names[step.which % len(self._names)], self._content(line, step.value)
        self._settle_transfer(line)
        answer, there = line.ask("upload_name", data=name), name in self._files
        expect(
            answer.accepted is not there,
            UserMessage(
                "{name} was {value} although there is {value_2}",
                name=show(name),
                value="accepted" if there else "refused",
                value_2="one" if there else "none",
            ),
            expected="0" if there else "1",
            observed=f"{answer}",
            requirement="5.2/3" if there else "5.2/2",
        )
        if there:
            return f"upload {show(name)} again"
        for chunk in chunks_of(content):
            send_chunk(line, chunk)
        self._files[name] = content
        if step.value >= ENDLESS:
            self._endless.append(name)
        return f"upload {show(name)} of {len(content)} bytes"

    def _download(self, step: Step, line: OutgoingConnection) -> str | None:
        name = self._name(step)
        self._settle_transfer(line)
        got, due = download(line, name), self._files.get(name)
        self._fetching = line
        if due is None:
            message = UserMessage("{name} is not there and was promised", name=show(name))
            expect(got is None, message, expected="0", observed="1", requirement="5.3/3")
        else:
            expect(
                got == due,
                UserMessage("{name} is not what was uploaded", name=show(name)),
                expected=f"{len(due)} bytes",
                observed="0" if got is None else f"{len(got)} bytes",
                requirement="5.2/12",
            )
        return f"download {show(name)}"

    def _delete(self, step: Step, line: OutgoingConnection) -> str | None:
        name = self._name(step)
        self._settle_transfer(line)
        answer, there = line.ask("delete_program", data=name), name in self._files
        if there and not answer.accepted and self._is_default(name, line):  # A-4.11-1
            return f"delete {show(name)}, refused"
        expect(
            answer.accepted is there,
            UserMessage(
                "{name} was {value}deleted although there is {value_2}",
                name=show(name),
                value="not " if there else "",
                value_2="one" if there else "none",
            ),
            expected="1" if there else "0",
            observed=f"{answer}",
            requirement="4.11/2" if there else "4.11/4",
        )
        self._files.pop(name, None)
        self._endless = [each for each in self._endless if each != name]
        if there and name == self._named:
            self._named = self._default = None
        return f"delete {show(name)}"

    def _is_default(self, name: bytes, line: OutgoingConnection) -> bool:
        """Whether this is the default program, perhaps since an earlier sequence (A-4.13-1)."""
        if name == self._named:
            return True
        with suppress(CaseFailed):  # without a default program there may be no reply (A-4.12-2)
            return bool(line.ask("get_default_program").value == name)
        return False

    def _settle_transfer(self, line: OutgoingConnection) -> None:
        """Let a download be over for the subject, too, before another connection is used for files.

        The answer to the last chunk has no reply; a file in transfer may be kept (A-4.11-1), and
        there may be one transfer at a time (A-5-17).
        """
        fetching, self._fetching = self._fetching, None
        if fetching not in (None, line) and not fetching.closed and fetching.ending is None:
            fetching.sync()

    def _list_programs(self, _: Step, line: OutgoingConnection) -> str | None:
        listed = [name for name in program_names(self._subject, line) if name in self._names]
        for name in self._names:
            if (name in listed) is not (name in self._files):
                raise CaseFailed(
                    UserMessage(
                        "{name} is {value}listed",
                        name=show(name),
                        value="" if name in listed else "not ",
                    ),
                    expected=" ".join(map(show, sorted(self._files))) or "none",
                    observed=" ".join(map(show, listed)) or "none",
                    requirement="4.10/11" if name in self._files else "4.11/3",
                )
        return "list"

    def _set_default(self, step: Step, line: OutgoingConnection) -> str | None:
        name = self._name(step)
        answer = line.ask("set_default_program", name)
        if name in self._files:
            expect(
                answer.accepted,
                UserMessage(
                    "{name}, which is stored, cannot be made the default program", name=show(name)
                ),
                expected="1",
                observed=f"{answer}",
                requirement="4.13/2",
            )
            self._default = name
        elif answer.accepted:  # which is only warned of (A-4.13-1)
            self._default = None
        if answer.accepted:
            self._named = name
        return f"make {show(name)} the default"

    def _get_default(self, _: Step, line: OutgoingConnection) -> str | None:
        if self._default is None:  # there may be none, and no answer (A-4.12-2)
            return None
        expect_default(self._subject, line, self._default, "4.13/3")
        return "ask for the default"
