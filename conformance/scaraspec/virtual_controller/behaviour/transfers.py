"""Behaviour of the file transfer commands of clause 5."""

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import FILE_DATA, Chunk, Receiver, Sender, TransferState
from scaraspec.virtual_controller.behaviour.base import NAME_MAX_BYTES, SILENCE, Base, Silence
from scaraspec.virtual_controller.session import OpenTransfer, Request, Session
from scaraspec.virtual_controller.store import StoreError

_EMPTY = Chunk(file_size=0, position=0, length=0, buffer=b"")


class Transfers(Base):
    """Uploads and downloads, one at a time per connection (A-5-17)."""

    def upload_name(self, request: Request) -> bool:
        """5.2: accepted if the name does not exist (L748) and the file can be created."""
        name: bytes = request.value
        if not self._can_begin(request.session) or not self._is_name_free(name):
            return False
        if self.dialect["empty_file"] == "name-only" and not self._write(name, b""):
            return False
        receiver = Receiver(request.now_s, self.dialect)
        request.session.transfer = OpenTransfer(name, receiver)
        return True

    def _is_name_free(self, name: bytes) -> bool:
        """Whether a file with this name may be created (A-5-11, A-5-20)."""
        if (
            name in self.store
            or any(s.transfer and s.transfer.name == name for s in self.sessions.values())
            or len(name) > NAME_MAX_BYTES
            or not self.has_program_extension(name)
            or not self.is_text(name)
        ):
            return False
        return self._has_room(name, 0)

    def upload_chunk(self, request: Request) -> bool | Silence:
        """5.2: the receiver checks the chunk; without an upload the reply is ``0`` (A-5-16)."""
        session, transfer = request.session, request.session.transfer
        if transfer is None or not isinstance(transfer.end, Receiver):
            return False
        receiver = transfer.end
        accepted = receiver.receive_chunk(request.frame.data, request.now_s)
        if accepted and not self._has_room(transfer.name, self._announced_bytes()):
            receiver.fail("the store is full")
            accepted = False
        if receiver.state is TransferState.DONE:
            session.transfer = None
            accepted = self._write(transfer.name, receiver.content)
        elif receiver.state is TransferState.FAILED:
            self.abort_transfer(session)
        return SILENCE if accepted is None else accepted

    def _announced_bytes(self) -> int:
        """Total file size of all uploads in progress."""
        ends = (session.transfer.end for session in self.sessions.values() if session.transfer)
        return sum(end.size_bytes or 0 for end in ends if isinstance(end, Receiver))

    def _has_room(self, name: bytes, size_bytes: int) -> bool:
        try:
            self.store.check(name, size_bytes)
        except StoreError:
            return False
        return not self.plant.disk_full

    def _write(self, name: bytes, content: bytes) -> bool:
        if self.plant.disk_full:
            return False
        try:
            self.store.write(name, content)
        except StoreError:
            return False
        return True

    def download_name(self, request: Request) -> bool:
        """5.3: accepted if the file is stored; the first chunk follows at once (A-5-23)."""
        session, name = request.session, request.value
        if not self._can_begin(session) or name not in self.store:
            return False
        content = self.store.read(name)
        if content:
            session.transfer = OpenTransfer(name, Sender(content, request.now_s, self.dialect))
            self._send_next(session)
        elif self.dialect["empty_file"] == "chunk":
            self._send_chunk(session, _EMPTY)
        return bool(content) or self.dialect["empty_file"] != "refused"

    def download_chunk(self, request: Request) -> Silence:
        """5.3: the client's reply to a chunk (A-5-19); ignored if unexpected (A-5-16)."""
        session, transfer = request.session, request.session.transfer
        if transfer is not None and isinstance(transfer.end, Sender):
            transfer.end.acknowledge(request.value is True, request.now_s)
            self._send_next(session)
            if transfer.end.state is not TransferState.ACTIVE:
                session.transfer = None
        return SILENCE

    def _send_next(self, session: Session) -> None:
        if session.transfer is not None and isinstance(session.transfer.end, Sender):
            chunk = session.transfer.end.next_chunk()
            if chunk is not None:
                self._send_chunk(session, chunk)

    def _send_chunk(self, session: Session, chunk: Chunk) -> None:
        data = FILE_DATA.encode(chunk, self.dialect)
        self.send_after_reply(session, Frame(C2A, BY_NAME["download_chunk"].opcode, data))

    def _can_begin(self, session: Session) -> bool:
        """Whether a transfer may start; the reading "replace" aborts the current one."""
        if session.transfer is None:
            return True
        if self.dialect["xfer_concurrency"] == "refuse":
            return False
        self.abort_transfer(session)
        return True

    def abort_transfer(self, session: Session) -> None:
        """Abort the transfer of a session; a partial upload is removed or kept (A-5-12)."""
        transfer, session.transfer = session.transfer, None
        if transfer is None or not isinstance(transfer.end, Receiver):
            return
        if self.dialect["partial_keep"] == "keep":
            self._write(transfer.name, transfer.end.content)
        elif transfer.end.received_bytes:
            self.remove(transfer.name)  # exists only if "name-only" created it (A-5-10)
