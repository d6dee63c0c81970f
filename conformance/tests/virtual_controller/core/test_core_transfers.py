"""File transfer: clause 5 with the controller as receiver (0x50, 0x52) and sender (0x54, 0x56)."""

from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scaraspec.protocol.readings import Dialect
from scaraspec.protocol.transfer import FILE_DATA, Chunk, chunks_of
from scaraspec.virtual_controller.store import StoreError


def _chunk(file_size: int, position: int, data: bytes, **readings: str) -> bytes:
    chunk = Chunk(file_size, position, len(data), data)
    return FILE_DATA.encode(chunk, Dialect.of(**readings))


def _upload(client: Any, name: bytes, content: bytes, **readings: str) -> list[bytes | None]:
    answers = [client.ask("upload_name", name)]
    for chunk in chunks_of(content):
        data = FILE_DATA.encode(chunk, Dialect.of(**readings))
        answers.append(client.ask("upload_chunk", data))
    return answers


def _download(client: Any, name: bytes, **readings: str) -> bytes:
    client.send("download_name", name)
    received = client.receive()
    assert received[0] == ("download_name", b"1")
    content = b""
    (_, data), *rest = received[1:]
    while True:
        assert rest == []
        chunk = FILE_DATA.decode(data).value
        assert chunk.position == len(content)
        assert data == FILE_DATA.encode(chunk, Dialect.of(**readings))
        content += chunk.data
        client.send("download_chunk", b"1")
        received = client.receive()
        if not received:
            return content
        ((_, data), *rest) = received


@pytest.mark.parametrize("size_bytes", [1, 199, 200, 201, 400, 51_200, 65_535, 65_536, 70_000])
def test_a_file_is_downloaded_unchanged(bench: Any, size_bytes: int) -> None:
    """A download has the bytes of the upload (5.2/12, 5.2/16)."""
    content = (bytes(range(256)) * 300)[:size_bytes]
    client = bench.client()
    assert set(_upload(client, b"f", content)) == {b"1"}
    assert client.ask("list_programs") == b"0|f"
    assert _download(client, b"f") == content


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.binary(min_size=1, max_size=900))
def test_any_content_is_downloaded_unchanged(bench_of: Any, content: bytes) -> None:
    """Requirement 5.2/14: bytes AA, CC, 00 and 7C among them."""
    client = bench_of().client()
    _upload(client, b"f", content + b"\xaa\xcc\x00|")
    assert _download(client, b"f") == content + b"\xaa\xcc\x00|"


@pytest.mark.parametrize("endian", ["little", "big"])
@pytest.mark.parametrize("truncation", ["full", "truncated"])
def test_the_form_of_chunks_is_a_reading(bench_of: Any, endian: str, truncation: str) -> None:
    """A-5-2 and A-5-3: both forms are accepted, the one of the dialect is sent."""
    readings = {"endian": endian, "chunk_trunc": truncation}
    client = bench_of(**readings).client()
    content = bytes(range(250))
    _upload(client, b"f", content, endian="big")
    _upload(client, b"g", content, chunk_trunc="truncated")
    assert _download(client, b"f", **readings) == content
    assert _download(client, b"g", **readings) == content


def test_an_existing_name_is_refused(bench: Any) -> None:
    """Requirement 5.2/3 (L739, L748): the name of a stored file, or of an upload by another
    client."""
    bench.store.write(b"f", b"old")
    client, other = bench.client(), bench.client()
    assert client.ask("upload_name", b"f") == b"0"
    assert bench.store.read(b"f") == b"old"
    assert other.ask("upload_name", b"g") == b"1"
    assert client.ask("upload_name", b"g") == b"0"


def test_longest_name_that_is_accepted(bench: Any) -> None:
    """A-5-20: the longest reply with the name has 255 bytes."""
    client = bench.client()
    assert client.ask("upload_name", b"x" * 245) == b"0"
    assert client.ask("upload_name", b"x" * 244) == b"1"


def test_a_chunk_without_an_upload_is_refused(bench: Any) -> None:
    """Requirement 5.2/11 (A-5-16); a reply to a chunk without a download is ignored."""
    client = bench.client()
    assert client.ask("upload_chunk", _chunk(3, 0, b"abc")) == b"0"
    assert client.ask("download_chunk", b"1") is None


def test_no_chunk_is_accepted_after_the_last(bench: Any) -> None:
    """Requirement 5.2/13: the transfer ends with the reply to the last chunk."""
    client = bench.client()
    _upload(client, b"f", b"abc")
    assert client.ask("upload_chunk", _chunk(3, 0, b"xyz")) == b"0"
    assert bench.store.read(b"f") == b"abc"


@pytest.mark.parametrize(
    ("bad", "answer"),
    [
        (Chunk(600, 200, 201, bytes(200)), b"0"),
        (Chunk(300, 200, 200, bytes(200)), b"0"),
        (Chunk(600, 0, 200, bytes(200)), b"0"),
        (Chunk(600, 400, 200, bytes(200)), b"0"),
        (Chunk(601, 200, 200, bytes(200)), b"0"),
        (Chunk(600, 200, 0, b""), None),
    ],
    ids=["length", "beyond", "again", "gap", "size", "zero"],
)
def test_an_invalid_chunk_aborts_the_upload(bench: Any, bad: Chunk, answer: bytes | None) -> None:
    """A-5-6 to A-5-10 and A-5-12: a bad chunk is refused, the error signal gets no reply; the
    connection stays."""
    client = bench.client()
    client.ask("upload_name", b"f")
    assert client.ask("upload_chunk", _chunk(600, 0, bytes(200))) == b"1"
    assert client.ask("upload_chunk", FILE_DATA.encode(bad)) == answer
    assert client.ask("upload_chunk", _chunk(600, 200, bytes(200))) == b"0"
    assert client.ask("list_programs") == b"0"
    assert client.ask("upload_name", b"f") == b"1"


def test_the_error_signal_may_be_a_frame_without_data(bench: Any) -> None:
    """L787, A-5-10: a frame of length 0 ends the upload without a reply."""
    client = bench.client()
    client.ask("upload_name", b"f")
    assert client.ask("upload_chunk", b"") is None
    assert client.ask("upload_chunk", _chunk(3, 0, b"abc")) == b"0"


def test_silence_of_more_than_thirty_seconds_ends_an_upload(bench: Any) -> None:
    """Requirement 5.4/5 (L795): pauses of 30 s do not end it, a longer one does."""
    client = bench.client()
    client.ask("upload_name", b"f")
    for position in range(0, 1000, 200):
        assert client.receive(30.0) == []
        assert client.ask("upload_chunk", _chunk(1400, position, bytes(200))) == b"1"
    assert client.receive(30.01) == []
    assert client.ask("upload_chunk", _chunk(1400, 1000, bytes(200))) == b"0"
    assert client.ask("list_programs") == b"0"
    assert client.ask("get_status") == b"00"


def test_silence_of_more_than_thirty_seconds_ends_a_download(bench: Any) -> None:
    """A later reply to a chunk has no effect (5.3/7, L787)."""
    bench.store.write(b"f", bytes(600))
    client = bench.client()
    client.send("download_name", b"f")
    assert len(client.receive(30.0)) == 2
    client.send("download_chunk", b"1")
    assert len(client.receive(30.1)) == 1
    client.send("download_chunk", b"1")
    assert client.receive(1.0) == []


def test_the_timeout_is_a_reading(bench_of: Any) -> None:
    """The dialect sets the timeout (A-5-13)."""
    client = bench_of(xfer_timeout="5").client()
    client.ask("upload_name", b"f")
    client.receive(5.1)
    assert client.ask("upload_chunk", _chunk(3, 0, b"abc")) == b"0"


@pytest.mark.parametrize("answer", [b"0", b"", b"x", b"11"])
def test_a_refused_chunk_ends_the_download(bench: Any, answer: bytes) -> None:
    """Requirement 5.3/9 (A-5-14): only 1 accepts a chunk."""
    bench.store.write(b"f", bytes(600))
    client = bench.client()
    client.send("download_name", b"f")
    client.receive()
    client.send("download_chunk", answer)
    assert client.receive(1.0) == []
    client.send("download_chunk", b"1")
    assert client.receive(1.0) == []


def test_a_missing_file_cannot_be_downloaded(bench: Any) -> None:
    """The name is refused (5.3/3, 5.3/10)."""
    client = bench.client()
    assert client.ask("download_name", b"f") == b"0"
    assert client.receive(40.0) == []


@pytest.mark.parametrize("second", ["upload_name", "download_name"])
def test_a_second_transfer_on_a_connection_is_refused(bench: Any, second: str) -> None:
    """A-5-17 (a): the first continues; another connection has its own transfer."""
    bench.store.write(b"old", b"x")
    client, other = bench.client(), bench.client()
    client.ask("upload_name", b"f")
    assert client.ask(second, b"old" if second == "download_name" else b"g") == b"0"
    assert other.ask("upload_name", b"g") == b"1"
    assert client.ask("upload_chunk", _chunk(3, 0, b"abc")) == b"1"
    assert bench.store.read(b"f") == b"abc"


def test_a_second_transfer_can_replace_the_first(bench_of: Any) -> None:
    """The first transfer ends when the second starts (A-5-17 b)."""
    bench = bench_of(xfer_concurrency="replace")
    client = bench.client()
    client.ask("upload_name", b"f")
    assert client.ask("upload_name", b"g") == b"1"
    assert client.ask("upload_chunk", _chunk(3, 0, b"abc")) == b"1"
    assert bench.store.names() == [b"g"]


def test_a_replaced_upload_counts_as_interrupted(bench_of: Any) -> None:
    """A-5-12 (b) also applies to it."""
    bench = bench_of(xfer_concurrency="replace", partial_keep="keep")
    client = bench.client()
    client.ask("upload_name", b"f")
    client.ask("upload_chunk", _chunk(600, 0, bytes(200)))
    assert client.ask("upload_name", b"g") == b"1"
    assert bench.store.read(b"f") == bytes(200)


def test_a_new_upload_in_the_segment_of_an_invalid_chunk(bench: Any) -> None:
    """A bad chunk and a new upload may arrive in one segment."""
    client = bench.client()
    client.ask("upload_name", b"f")
    bad = b"\xaa\x52\xd4" + _chunk(600, 200, bytes(200)) + b"\xcc"
    client.link.send(bad + b"\xaa\x50\x01f\xcc")
    assert client.receive() == [("upload_chunk", b"0"), ("upload_name", b"1")]


def test_other_commands_are_served_during_a_transfer(bench: Any) -> None:
    """Queries between two chunks get their replies (5.4/8)."""
    client = bench.client()
    client.ask("upload_name", b"f")
    assert client.ask("get_status") == b"00"
    assert client.ask("upload_chunk", _chunk(3, 0, b"abc")) == b"1"


def test_a_lost_link_ends_its_transfer(bench: Any) -> None:
    """A-5-12: the name can be used again."""
    client, other = bench.client(), bench.client()
    client.ask("upload_name", b"f")
    client.ask("upload_chunk", _chunk(600, 0, bytes(200)))
    client.link.close()
    assert other.ask("upload_name", b"f") == b"1"


def test_keeping_a_partial_file_is_a_reading(bench_of: Any) -> None:
    """A-5-12 (b): it is listed, and blocks its name until it is deleted."""
    bench = bench_of(partial_keep="keep")
    client = bench.client()
    client.ask("upload_name", b"f")
    client.ask("upload_chunk", _chunk(600, 0, bytes(200)))
    client.receive(31.0)
    assert client.ask("list_programs") == b"0|f"
    assert bench.store.read(b"f") == bytes(200)
    assert client.ask("upload_name", b"f") == b"0"
    assert client.ask("delete_program", b"f") == b"1"
    client.ask("upload_name", b"f")
    bench.plant.disk_full = True
    client.receive(31.0)
    assert bench.store.names() == []


def test_keeping_a_partial_file_after_a_lost_link(bench_of: Any) -> None:
    """A-5-12 (b): the loss of the link also interrupts the transfer."""
    bench = bench_of(partial_keep="keep")
    client = bench.client()
    client.ask("upload_name", b"f")
    client.ask("upload_chunk", _chunk(600, 0, bytes(200)))
    client.link.reset()
    assert bench.store.read(b"f") == bytes(200)


def test_chunks_in_any_order_are_a_reading(bench_of: Any) -> None:
    """A-5-8 (c): the file is complete when no bytes are missing."""
    bench = bench_of(chunk_order="any")
    client = bench.client()
    client.ask("upload_name", b"f")
    assert client.ask("upload_chunk", _chunk(300, 200, b"b" * 100)) == b"1"
    assert client.ask("upload_chunk", _chunk(300, 0, b"a" * 200)) == b"1"
    assert bench.store.read(b"f") == b"a" * 200 + b"b" * 100


def test_empty_files_are_refused(bench: Any) -> None:
    """An upload with a file size of 0 is refused (A-5-10 a)."""
    bench.store.write(b"e", b"")
    assert bench.client().ask("download_name", b"e") == b"0"


def test_an_empty_file_by_its_name_is_a_reading(bench_of: Any) -> None:
    """A-5-10 (b): it exists immediately, chunks fill it, and an interrupted upload deletes it."""
    bench = bench_of(empty_file="name-only")
    client = bench.client()
    assert client.ask("upload_name", b"e") == b"1"
    assert client.ask("list_programs") == b"0|e"
    client.receive(31.0)
    assert bench.store.read(b"e") == b""
    assert client.ask("download_name", b"e") == b"1"
    _upload(client, b"f", b"abc")
    assert bench.store.read(b"f") == b"abc"
    client.ask("upload_name", b"g")
    client.ask("upload_chunk", _chunk(600, 0, bytes(200)))
    client.receive(31.0)
    assert bench.store.names() == [b"e", b"f"]


def test_an_empty_file_is_refused_if_the_disk_is_full(
    bench_of: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The name is refused if the file cannot be created (A-5-21, A-5-10 b)."""

    def fail(*_: object) -> None:
        raise StoreError("the disk failed")

    bench = bench_of(empty_file="name-only")
    monkeypatch.setattr(bench.store, "write", fail)
    assert bench.client().ask("upload_name", b"e") == b"0"


def test_an_empty_file_by_an_empty_chunk_is_a_reading(bench_of: Any) -> None:
    """A chunk of length 0 creates an empty file (A-5-10 c)."""
    bench = bench_of(empty_file="chunk")
    client = bench.client()
    client.ask("upload_name", b"e")
    assert client.ask("upload_chunk", _chunk(0, 0, b"")) == b"1"
    client.send("download_name", b"e")
    assert client.receive() == [("download_name", b"1"), ("download_chunk", _chunk(0, 0, b""))]
    client.send("download_chunk", b"1")
    assert client.receive(1.0) == []


def test_a_full_disk_refuses_at_each_step(bench: Any) -> None:
    """A-5-21, A-5-25: at the name, the first chunk and the last chunk."""
    client = bench.client()
    bench.plant.disk_full = True
    assert client.ask("upload_name", b"f") == b"0"
    bench.plant.disk_full = False
    assert client.ask("upload_name", b"f") == b"1"
    bench.plant.disk_full = True
    assert client.ask("upload_chunk", _chunk(300, 0, bytes(200))) == b"0"
    assert bench.store.names() == []


def test_announced_sizes_of_other_uploads_count(bench: Any) -> None:
    """A-5-25: a size is refused at the first chunk, with the announced sizes of other uploads
    counted."""
    client, other = bench.client(), bench.client()
    client.ask("upload_name", b"f")
    other.ask("upload_name", b"g")
    big = 3 * 2**20
    assert client.ask("upload_chunk", _chunk(big, 0, bytes(200))) == b"1"
    assert other.ask("upload_chunk", _chunk(big, 0, bytes(200))) == b"0"
    assert client.ask("upload_chunk", _chunk(big, 200, bytes(200))) == b"1"
