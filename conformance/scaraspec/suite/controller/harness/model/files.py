"""Steps that upload, download, list and delete files, and set the default program."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Final

from scaraspec.protocol.fields import show
from scaraspec.protocol.transfer import FILE_DATA_BYTES, chunks_of
from scaraspec.suite.controller.harness.malformed.delivery import SLOWEST_S
from scaraspec.suite.controller.harness.model.connections import ConnectionSteps
from scaraspec.suite.controller.harness.model.state import ENDLESS, Step, Writes
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import (
    begin_upload,
    is_plain,
    next_chunk,
    receive_chunks,
    require_place,
    send_chunk,
)
from scaraspec.suite.controller.harness.requests.queries import Query, supported_queries
from scaraspec.suite.controller.harness.state.defaults import expect_default
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect
from scaraspec.suite.program_files.layout import configured, layout_in_use
from scaraspec.suite.program_files.listed import program_names
from scaraspec.suite.program_files.writing import (
    OUTPUTS,
    endless_loop,
    program_file,
    set_output,
    wait,
)
from scaraspec.user_message import UserMessage

_UNINTERRUPTED: Final = 5  # one of so many transfers and requests in parts is not interrupted
_ABANDONED_BYTES: Final = 900  # more chunks than are sent
_ABANDONMENTS: Final = 4  # ways to end a transfer
_ERROR_SIGNALS: Final = (b"", bytes(FILE_DATA_BYTES))
_SIZES: Final = 8  # how many sizes the programs of one value have
_ALIASES: Final = 10**29  # an alias may have 30 bytes with a NUL (A-6.5-1)
_BETWEEN: Final = (
    ("set_centre", "get_poses"),
    ("query",),
    ("set_clock", "get_clock"),
    ("get_default",),
    ("log_in",),
    ("set_output", "get_outputs"),
    ("look",),
)
"""Steps that may take place on another connection, between two chunks or parts of a request."""
_IN_PARTS: Final = ("list_programs",)  # queries with several replies
_NS: Final = 1e9


class FileSteps(ConnectionSteps):
    """Transfers, lists and deletes files."""

    def _send_in_parts(self, step: Step, line: OutgoingConnection) -> str:
        """Send a query in two parts, and other requests on another connection between them."""
        queries = [each for each in supported_queries(self._subject) if each.name not in _IN_PARTS]
        query = queries[step.turn % len(queries)]
        self._query_around(
            query, step, line, lambda: self._interleave(step, line, UserMessage("in a request"))
        )
        return UserMessage("{command} in two parts", command=query.name)

    def _query_around(
        self, query: Query, step: Step, line: OutgoingConnection, act: Callable[[], None]
    ) -> None:
        """Send a query in two parts, and act between them; send nothing on this line there."""
        frame, begun_ns = query.frame(line).encode(), self._subject.now_ns
        cut = step.random.randrange(1, len(frame))
        line.send_bytes(frame[:cut])
        act()
        longest_s = SLOWEST_S / self._subject.ics.time_scale
        if self._subject.now_ns - begun_ns > longest_s * _NS:  # it may have dropped it (A-3-11)
            self._replace(line)
            return
        line.send_bytes(frame[cut:])
        line.reply(query.name)

    def _interleave(self, step: Step, line: OutgoingConnection, when: str) -> None:
        """Perform other steps on another connection, except in some turns (A-5-17)."""
        possible = [acts for acts in _BETWEEN if set(acts) <= set(self._acts)]
        others = [other for other in self._lines if other is not line]
        turns, rest = divmod(step.turn, _UNINTERRUPTED)
        if possible and others and rest:
            turn = turns * (_UNINTERRUPTED - 1) + rest + len(step.act)
            for act in possible[turn % len(possible)]:
                description = getattr(self, f"_{act}")(step._replace(act=act), others[0])
                self.history.append(UserMessage.listed([description or act, when]))

    def _content(self, line: OutgoingConnection, step: Step) -> tuple[bytes, Writes]:
        """Return a program in one of several sizes, and the outputs that it sets.

        It may set outputs and end, or not end; then it sets none, because the nodes after its loop
        are not executed. Random aliases make its bytes differ from those of other programs.
        """
        dialect, layout, random = self._subject.dialect, layout_in_use(self._subject), step.random
        ports = [port for port in OUTPUTS if port in self._ports]
        writes = {port: bool(random.randrange(2)) for port in ports}
        nodes = [set_output(port, on=on) for port, on in writes.items()]
        if step.value >= ENDLESS:
            nodes, writes = [*endless_loop(dialect), *nodes], {}
        else:
            nodes += wait(0) * (1 + 2 * step.value + step.seed % _SIZES)
        named = [replace(node, alias=b"%d" % random.randrange(_ALIASES)) for node in nodes]
        base = configured(self._subject, line)
        return program_file(dialect, named, layout=layout, base=base), writes

    def _upload(self, step: Step, line: OutgoingConnection) -> str | None:
        name = self._names[(step.turn + (step.which == 0)) % len(self._names)]
        name, self._deleted = self._deleted or name, None
        content, writes = self._content(line, step)
        self._settle_transfer(line)
        answer, exists = line.ask("upload_name", data=name), name in self._files
        if answer.accepted is False and not is_plain(name):  # A-5-20
            return UserMessage("upload {name}, refused", name=show(name))
        if not (answer.accepted or exists):
            require_place(line, name)
        expect(
            answer.accepted is not exists,
            UserMessage(
                "the upload of {name} was {action} although the file {state}",
                name=show(name),
                action=UserMessage("accepted" if exists else "refused"),
                state=UserMessage("exists" if exists else "does not exist"),
            ),
            expected="0" if exists else "1",
            observed=f"{answer}",
            requirement="5.2/3" if exists else "5.2/2",
        )
        if exists:
            return UserMessage("upload {name} again", name=show(name))
        for number, chunk in enumerate(chunks_of(content)):
            if number == 1:
                self._interleave(step, line, UserMessage("during a transfer"))
            send_chunk(line, chunk)
        self._files[name], self._writes[name] = content, writes
        if step.value >= ENDLESS:
            self._endless_programs.append(name)
        return UserMessage(
            "upload {name} of {size_bytes} bytes", name=show(name), size_bytes=len(content)
        )

    def _abandon(self, step: Step, line: OutgoingConnection) -> str | None:
        """Break off an upload or a download in one of several ways."""
        self._settle_transfer(line)
        if self._subject.transfers_outlive:  # it blocks others until its timeout (A-5-17)
            return None
        if self._files and step.turn % _ABANDONMENTS == 0:
            return self._abandon_download(step, line)
        return self._abandon_upload(step, line)

    def _abandon_download(self, step: Step, line: OutgoingConnection) -> str:
        name = next(iter(self._files))
        if line.ask("download_name", data=name).accepted:
            next_chunk(line)
            line.answer_chunk(accepted=False)
            with suppress(NoReply):  # it may close the connection (A-5-26)
                line.sync()
        self._interleave(step, line, UserMessage("during a transfer"))
        self._replace(line)
        return UserMessage("abandon the download of {name}", name=show(name))

    def _abandon_upload(self, step: Step, line: OutgoingConnection) -> str | None:
        """Close or reset a connection during an upload, perhaps after the error signal (L787).

        Afterwards the file is deleted, because it may be kept (A-5-12).
        """
        free = [name for name in self._names if name not in self._files and is_plain(name)]
        if not free:
            return None
        name, content = free[step.turn % len(free)], step.random.randbytes(_ABANDONED_BYTES)
        begin_upload(line, name)
        for chunk in [*chunks_of(content)][: step.value]:
            send_chunk(line, chunk)
        self._interleave(step, line, UserMessage("during a transfer"))
        match step.turn % _ABANDONMENTS:
            case 1:
                line.send("upload_chunk", data=_ERROR_SIGNALS[step.seed % len(_ERROR_SIGNALS)])
                with suppress(NoReply):
                    line.sync()
            case 2 if line.ending is None:
                line.reset()
        new = self._replace(line)
        new.ask("delete_program", data=name)
        return UserMessage("abandon the upload of {name}", name=show(name))

    def _download(self, step: Step, line: OutgoingConnection) -> str | None:
        name = self._name(step)
        self._settle_transfer(line)
        received, expected = self._received(step, line, name), self._files.get(name)
        self._downloading_line = line
        if expected is None:
            message = UserMessage(
                "the download of {name} was accepted although the file does not exist",
                name=show(name),
            )
            expect(received is None, message, expected="0", observed="1", requirement="5.3/3")
        else:
            refused, content = "0", UserMessage("{count} bytes", count=len(received or b""))
            expect(
                received == expected,
                UserMessage("the content of {name} differs from the upload", name=show(name)),
                expected=UserMessage("{count} bytes", count=len(expected)),
                observed=refused if received is None else content,
                requirement="5.2/12",
            )
        return UserMessage("download {name}", name=show(name))

    def _received(self, step: Step, line: OutgoingConnection, name: bytes) -> bytes | None:
        """Download a file; None if the controller has no such file."""
        if not line.ask("download_name", data=name).accepted:
            return None
        content = b""
        for chunk in receive_chunks(line):
            if not content:
                self._interleave(step, line, UserMessage("during a transfer"))
            content += chunk.data
        return content

    def _delete(self, step: Step, line: OutgoingConnection) -> str | None:
        name = self._name(step)
        self._settle_transfer(line)
        answer, exists = line.ask("delete_program", data=name), name in self._files
        if exists and not answer.accepted and self._is_default(name, line):  # A-4.11-1
            return UserMessage("delete {name}, refused", name=show(name))
        expect(
            answer.accepted is exists,
            UserMessage(
                "the deletion of {name} was {action} although the file {state}",
                name=show(name),
                action=UserMessage("refused" if exists else "accepted"),
                state=UserMessage("exists" if exists else "does not exist"),
            ),
            expected="1" if exists else "0",
            observed=f"{answer}",
            requirement="4.11/2" if exists else "4.11/4",
        )
        self._files.pop(name, None)
        self._endless_programs = [each for each in self._endless_programs if each != name]
        if exists and name == self._accepted_default:
            self._accepted_default = self._default = None
            self._deleted = name
        return UserMessage("delete {name}", name=show(name))

    def _is_default(self, name: bytes, line: OutgoingConnection) -> bool:
        """Whether this is the default program, possibly set by an earlier sequence (A-4.13-1)."""
        if name == self._accepted_default:
            return True
        with suppress(CaseFailed):  # without a default program there may be no reply (A-4.12-2)
            return bool(line.ask("get_default_program").value == name)
        return False

    def _settle_transfer(self, line: OutgoingConnection) -> None:
        """Wait until a download has ended before another connection transfers a file.

        The answer to the last chunk has no reply. The controller may refuse to delete a file in
        transfer (A-4.11-1), and may serve one transfer at a time (A-5-17).
        """
        previous, self._downloading_line = self._downloading_line, None
        if previous not in (None, line) and not previous.closed and previous.ending is None:
            previous.sync()

    def _list_programs(self, _: Step, line: OutgoingConnection) -> str | None:
        listed = [name for name in program_names(self._subject, line) if name in self._names]
        for name in self._names:
            if (name in listed) is not (name in self._files):
                raise CaseFailed(
                    UserMessage(
                        "{name} is {state}",
                        name=show(name),
                        state=UserMessage("listed" if name in listed else "not listed"),
                    ),
                    expected=" ".join(map(show, sorted(self._files))) or "none",
                    observed=" ".join(map(show, listed)) or "none",
                    requirement="4.10/11" if name in self._files else "4.11/3",
                )
        return UserMessage("list the programs")

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
        elif answer.accepted:  # this causes only a warning (A-4.13-1)
            self._default = None
        if answer.accepted:
            self._accepted_default = name
        return UserMessage("make {name} the default", name=show(name))

    def _get_default(self, _: Step, line: OutgoingConnection) -> str | None:
        if self._default is None:  # there may be no reply (A-4.12-2)
            return None
        expect_default(self._subject, line, self._default, "4.13/3")
        return UserMessage("query the default program")
