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
    heard = client.hear()
    assert heard[0] == ("download_name", b"1")
    content = b""
    (_, data), *rest = heard[1:]
    while True:
        assert rest == []
        chunk = FILE_DATA.decode(data).value
        assert chunk.position == len(content)
        assert data == FILE_DATA.encode(chunk, Dialect.of(**readings))
        content += chunk.data
        client.send("download_chunk", b"1")
        heard = client.hear()
        if not heard:
            return content
        ((_, data), *rest) = heard


@pytest.mark.parametrize("size_bytes", [1, 199, 200, 201, 400, 51_200, 65_535, 65_536, 70_000])
def test_a_file_comes_back_as_it_was_sent(bench: Any, size_bytes: int) -> None:
    """Requirements 5.2/12 and 5.2/16."""
    content = (bytes(range(256)) * 300)[:size_bytes]
    client = bench.client()
    assert set(_upload(client, b"f", content)) == {b"1"}
    assert client.ask("list_programs") == b"0|f"
    assert _download(client, b"f") == content


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.binary(min_size=1, max_size=900))
def test_any_content_comes_back(bench_of: Any, content: bytes) -> None:
    """Requirement 5.2/14: bytes AA, CC, 00 and 7C among them."""
    client = bench_of().client()
    _upload(client, b"f", content + b"\xaa\xcc\x00|")
    assert _download(client, b"f") == content + b"\xaa\xcc\x00|"


@pytest.mark.parametrize("endian", ["little", "big"])
@pytest.mark.parametrize("truncation", ["full", "truncated"])
def test_how_chunks_are_written_is_a_reading(bench_of: Any, endian: str, truncation: str) -> None:
    """A-5-2 and A-5-3: both are understood, the dialect's is sent."""
    readings = {"endian": endian, "chunk_trunc": truncation}
    client = bench_of(**readings).client()
    content = bytes(range(250))
    _upload(client, b"f", content, endian="big")
    _upload(client, b"g", content, chunk_trunc="truncated")
    assert _download(client, b"f", **readings) == content
    assert _download(client, b"g", **readings) == content


def test_a_name_that_is_taken_is_refused(bench: Any) -> None:
    """Requirement 5.2/3 (L739, L748): stored, or on its way from another client."""
    bench.store.write(b"f", b"old")
    client, other = bench.client(), bench.client()
    assert client.ask("upload_name", b"f") == b"0"
    assert bench.store.read(b"f") == b"old"
    assert other.ask("upload_name", b"g") == b"1"
    assert client.ask("upload_name", b"g") == b"0"


def test_a_name_as_long_as_every_reply_allows_is_taken(bench: Any) -> None:
    """A-5-20 in view of the longest reply."""
    client = bench.client()
    assert client.ask("upload_name", b"x" * 245) == b"0"
    assert client.ask("upload_name", b"x" * 244) == b"1"


def test_a_chunk_without_an_upload_is_refused(bench: Any) -> None:
    """Requirement 5.2/11 (A-5-16); an answer without a download is ignored."""
    client = bench.client()
    assert client.ask("upload_chunk", _chunk(3, 0, b"abc")) == b"0"
    assert client.ask("download_chunk", b"1") is None


def test_nothing_is_taken_after_the_last_chunk(bench: Any) -> None:
    """Requirement 5.2/13: the transfer has ended at the last chunk's answer."""
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
def test_a_bad_chunk_ends_the_upload_and_leaves_nothing(
    bench: Any, bad: Chunk, answer: bytes | None
) -> None:
    """A-5-6 to A-5-10 and A-5-12: refused, the error signal without an answer; the link stays."""
    client = bench.client()
    client.ask("upload_name", b"f")
    assert client.ask("upload_chunk", _chunk(600, 0, bytes(200))) == b"1"
    assert client.ask("upload_chunk", FILE_DATA.encode(bad)) == answer
    assert client.ask("upload_chunk", _chunk(600, 200, bytes(200))) == b"0"
    assert client.ask("list_programs") == b"0"
    assert client.ask("upload_name", b"f") == b"1"


def test_the_error_signal_may_be_a_frame_without_data(bench: Any) -> None:
    """L787, A-5-10: a frame of length 0 ends the upload without an answer."""
    client = bench.client()
    client.ask("upload_name", b"f")
    assert client.ask("upload_chunk", b"") is None
    assert client.ask("upload_chunk", _chunk(3, 0, b"abc")) == b"0"


def test_silence_of_more_than_thirty_seconds_ends_an_upload(bench: Any) -> None:
    """Requirement 5.4/5 (L795): 29 s again and again are survived, more than 30 s are not."""
    client = bench.client()
    client.ask("upload_name", b"f")
    for position in range(0, 1000, 200):
        assert client.hear(30.0) == []
        assert client.ask("upload_chunk", _chunk(1400, position, bytes(200))) == b"1"
    assert client.hear(30.01) == []
    assert client.ask("upload_chunk", _chunk(1400, 1000, bytes(200))) == b"0"
    assert client.ask("list_programs") == b"0"
    assert client.ask("get_status") == b"00"


def test_silence_of_more_than_thirty_seconds_ends_a_download(bench: Any) -> None:
    """Requirement 5.3/7 (L787)."""
    bench.store.write(b"f", bytes(600))
    client = bench.client()
    client.send("download_name", b"f")
    assert len(client.hear(30.0)) == 2
    client.send("download_chunk", b"1")
    assert len(client.hear(30.1)) == 1
    client.send("download_chunk", b"1")
    assert client.hear(1.0) == []


def test_the_time_out_is_a_reading(bench_of: Any) -> None:
    """A-5-13."""
    client = bench_of(xfer_timeout="5").client()
    client.ask("upload_name", b"f")
    client.hear(5.1)
    assert client.ask("upload_chunk", _chunk(3, 0, b"abc")) == b"0"


@pytest.mark.parametrize("answer", [b"0", b"", b"x", b"11"])
def test_a_refused_chunk_ends_the_download(bench: Any, answer: bytes) -> None:
    """Requirement 5.3/9 (A-5-14): whatever is not 1 is no acceptance."""
    bench.store.write(b"f", bytes(600))
    client = bench.client()
    client.send("download_name", b"f")
    client.hear()
    client.send("download_chunk", answer)
    assert client.hear(1.0) == []
    client.send("download_chunk", b"1")
    assert client.hear(1.0) == []


def test_a_missing_file_cannot_be_downloaded(bench: Any) -> None:
    """Requirements 5.3/3 and 5.3/10."""
    client = bench.client()
    assert client.ask("download_name", b"f") == b"0"
    assert client.hear(40.0) == []


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
    """A-5-17 (b)."""
    bench = bench_of(xfer_concurrency="replace")
    client = bench.client()
    client.ask("upload_name", b"f")
    assert client.ask("upload_name", b"g") == b"1"
    assert client.ask("upload_chunk", _chunk(3, 0, b"abc")) == b"1"
    assert bench.store.names() == [b"g"]


def test_a_replaced_upload_is_a_broken_one(bench_of: Any) -> None:
    """A-5-12 (b) holds for it too."""
    bench = bench_of(xfer_concurrency="replace", partial_keep="keep")
    client = bench.client()
    client.ask("upload_name", b"f")
    client.ask("upload_chunk", _chunk(600, 0, bytes(200)))
    assert client.ask("upload_name", b"g") == b"1"
    assert bench.store.read(b"f") == bytes(200)


def test_a_broken_upload_is_over_for_the_next_request_of_the_same_piece(bench: Any) -> None:
    """A bad chunk and a new upload may come together."""
    client = bench.client()
    client.ask("upload_name", b"f")
    bad = b"\xaa\x52\xd4" + _chunk(600, 200, bytes(200)) + b"\xcc"
    client.link.send(bad + b"\xaa\x50\x01f\xcc")
    assert client.hear() == [("upload_chunk", b"0"), ("upload_name", b"1")]


def test_other_commands_are_served_during_a_transfer(bench: Any) -> None:
    """Requirement 5.4/8."""
    client = bench.client()
    client.ask("upload_name", b"f")
    assert client.ask("get_status") == b"00"
    assert client.ask("upload_chunk", _chunk(3, 0, b"abc")) == b"1"


def test_a_lost_link_ends_its_transfer(bench: Any) -> None:
    """A-5-12: the name is free again."""
    client, other = bench.client(), bench.client()
    client.ask("upload_name", b"f")
    client.ask("upload_chunk", _chunk(600, 0, bytes(200)))
    client.link.close()
    assert other.ask("upload_name", b"f") == b"1"


def test_a_partial_file_can_stay(bench_of: Any) -> None:
    """A-5-12 (b): it is listed, and blocks its name until it is deleted."""
    bench = bench_of(partial_keep="keep")
    client = bench.client()
    client.ask("upload_name", b"f")
    client.ask("upload_chunk", _chunk(600, 0, bytes(200)))
    client.hear(31.0)
    assert client.ask("list_programs") == b"0|f"
    assert bench.store.read(b"f") == bytes(200)
    assert client.ask("upload_name", b"f") == b"0"
    assert client.ask("delete_program", b"f") == b"1"
    client.ask("upload_name", b"f")
    bench.plant.disk_full = True
    client.hear(31.0)
    assert bench.store.names() == []


def test_what_a_lost_link_leaves_can_stay_too(bench_of: Any) -> None:
    """A-5-12 (b): the link was part of the transfer."""
    bench = bench_of(partial_keep="keep")
    client = bench.client()
    client.ask("upload_name", b"f")
    client.ask("upload_chunk", _chunk(600, 0, bytes(200)))
    client.link.reset()
    assert bench.store.read(b"f") == bytes(200)


def test_chunks_in_any_order_can_be_taken(bench_of: Any) -> None:
    """A-5-8 (c): complete when nothing is missing."""
    bench = bench_of(chunk_order="any")
    client = bench.client()
    client.ask("upload_name", b"f")
    assert client.ask("upload_chunk", _chunk(300, 200, b"b" * 100)) == b"1"
    assert client.ask("upload_chunk", _chunk(300, 0, b"a" * 200)) == b"1"
    assert bench.store.read(b"f") == b"a" * 200 + b"b" * 100


def test_empty_files_are_refused(bench: Any) -> None:
    """A-5-10 (a)."""
    bench.store.write(b"e", b"")
    assert bench.client().ask("download_name", b"e") == b"0"


def test_a_name_alone_can_make_an_empty_file(bench_of: Any) -> None:
    """A-5-10 (b): it is there at once, chunks fill it, and a broken upload leaves nothing."""
    bench = bench_of(empty_file="name-only")
    client = bench.client()
    assert client.ask("upload_name", b"e") == b"1"
    assert client.ask("list_programs") == b"0|e"
    client.hear(31.0)
    assert bench.store.read(b"e") == b""
    assert client.ask("download_name", b"e") == b"1"
    _upload(client, b"f", b"abc")
    assert bench.store.read(b"f") == b"abc"
    client.ask("upload_name", b"g")
    client.ask("upload_chunk", _chunk(600, 0, bytes(200)))
    client.hear(31.0)
    assert bench.store.names() == [b"e", b"f"]


def test_an_empty_file_that_cannot_be_made_is_refused(
    bench_of: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A-5-21 under A-5-10 (b)."""

    def fail(*_: object) -> None:
        raise StoreError("the disk failed")

    bench = bench_of(empty_file="name-only")
    monkeypatch.setattr(bench.store, "write", fail)
    assert bench.client().ask("upload_name", b"e") == b"0"


def test_a_chunk_of_length_0_can_be_an_empty_file(bench_of: Any) -> None:
    """A-5-10 (c)."""
    bench = bench_of(empty_file="chunk")
    client = bench.client()
    client.ask("upload_name", b"e")
    assert client.ask("upload_chunk", _chunk(0, 0, b"")) == b"1"
    client.send("download_name", b"e")
    assert client.hear() == [("download_name", b"1"), ("download_chunk", _chunk(0, 0, b""))]
    client.send("download_chunk", b"1")
    assert client.hear(1.0) == []


def test_a_full_disk_refuses_at_each_step(bench: Any) -> None:
    """A-5-21, A-5-25: the name, the first chunk, the last chunk."""
    client = bench.client()
    bench.plant.disk_full = True
    assert client.ask("upload_name", b"f") == b"0"
    bench.plant.disk_full = False
    assert client.ask("upload_name", b"f") == b"1"
    bench.plant.disk_full = True
    assert client.ask("upload_chunk", _chunk(300, 0, bytes(200))) == b"0"
    assert bench.store.names() == []


def test_uploads_together_promise_no_more_than_there_is_room_for(bench: Any) -> None:
    """A-5-25: a size is refused at its first chunk, counting what others have announced."""
    client, other = bench.client(), bench.client()
    client.ask("upload_name", b"f")
    other.ask("upload_name", b"g")
    big = 3 * 2**20
    assert client.ask("upload_chunk", _chunk(big, 0, bytes(200))) == b"1"
    assert other.ask("upload_chunk", _chunk(big, 0, bytes(200))) == b"0"
    assert client.ask("upload_chunk", _chunk(big, 200, bytes(200))) == b"1"
