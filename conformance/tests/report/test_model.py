"""results.json contains the whole model, is deterministic, and is validated when it is read."""

import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator  # type: ignore[import-untyped] # it has no types

from scaraspec.judge.verdicts import Cause, Conclusion, Verdict
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.hazard import Hazard
from scaraspec.report import model
from scaraspec.report.model import (
    SCHEMA,
    Case,
    Evidence,
    FrameField,
    ReadingSeen,
    RequirementResult,
    Results,
    ResultsError,
    Role,
    Subject,
    Tool,
)
from scaraspec.user_message import UserMessage

texts = st.text(max_size=20)
numbers = st.integers(-(2**63), 2**63 - 1)
evidence = st.builds(
    Evidence,
    *(texts, st.sampled_from(Direction), numbers, numbers, numbers, texts, texts),
    st.lists(st.builds(FrameField, texts, numbers, numbers, texts), max_size=2).map(tuple),
)
cases = st.builds(
    Case,
    texts,
    st.lists(texts, max_size=2).map(tuple),
    st.sampled_from(Verdict),
    st.none() | st.sampled_from(Cause),
    st.sampled_from(Hazard),
    *(texts, texts, texts),
    st.floats(allow_nan=False, allow_infinity=False),
    *(numbers, texts),
    st.lists(evidence, max_size=2).map(tuple),
)
readings = st.builds(
    ReadingSeen, st.lists(texts, max_size=2).map(tuple), st.booleans(), st.booleans(), texts
)
every_results = st.builds(
    Results,
    tool=st.builds(Tool, texts, texts),
    subject=st.builds(Subject, st.sampled_from(Role), texts, texts, texts, texts),
    role=st.sampled_from(Role),
    verdict=st.sampled_from(Conclusion),
    counts=st.dictionaries(st.sampled_from(Verdict), numbers),
    readings=st.dictionaries(texts, st.dictionaries(texts, readings, max_size=2), max_size=2),
    requirements=st.lists(
        st.builds(RequirementResult, texts, st.sampled_from(Verdict)), max_size=2
    ).map(tuple),
    cases=st.lists(cases, max_size=3).map(tuple),
)


@given(every_results)
def test_round_trip(results: Results) -> None:
    """Results with any texts and numbers are read as they were written."""
    assert Results.from_json(results.to_json().encode()) == results


def test_round_trip_of_a_file(full: Results, hostile: Results, tmp_path: Path) -> None:
    """A file with a session and hostile text is read as it was written."""
    path = tmp_path / "results.json"
    for results in (full, hostile):
        results.write(path)
        assert Results.read(path) == results


def test_equal_results_are_equal_bytes(full: Results) -> None:
    """Keys are sorted, so that a plain diff can compare two runs."""
    text = full.to_json()
    assert text == json.dumps(json.loads(text), ensure_ascii=False, indent=1, sort_keys=True) + "\n"
    assert "控制器" in text
    assert "\r" not in text


def test_public_keys(full: Results) -> None:
    """Other programs depend on these keys."""
    plain = json.loads(full.to_json())
    assert plain.keys() == {
        *("schema", "tool", "subject", "role", "verdict", "counts", "readings"),
        *("requirements", "cases", "session", "notices", "run", "undecided", "causes"),
    }
    assert plain["schema"] == "scaraspec.results/2"
    assert plain["tool"].keys() == {"name", "version"}
    assert plain["requirements"][1] == {"id": "3/18", "verdict": "fail", "cases": ["3/18"]}
    assert plain["counts"] == dict.fromkeys(
        ("none", "pass", "tolerated", "inconclusive", "fail", "error"), 1
    )
    assert all(
        case.keys()
        == {
            *("id", "requirements", "verdict", "cause", "hazard", "message", "expected"),
            *("observed", "duration_s", "examples", "replay", "wire", "passing"),
            *("attempts", "reason", "lines", "fingerprint", "title", "step"),
            *("date", "sittings", "operator", "side", "moment", "begin_ns"),
        }
        for case in plain["cases"]
    )
    assert plain["cases"][0]["cause"] is None
    assert {"connection", "direction", "offset_bytes", "length_bytes", "time_ns"} < plain["cases"][
        1
    ]["wire"][0].keys()


def test_a_truncated_file(full: Results, tmp_path: Path) -> None:
    """Truncated anywhere: one sentence that begins with the file name."""
    path, complete = tmp_path / "results.json", full.to_json().encode()
    for length in range(0, len(complete) - 1, 97):
        path.write_bytes(complete[:length])
        with pytest.raises(ResultsError) as caught:
            Results.read(path)
        assert str(caught.value).startswith(f"{path} is ")
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("raw", "printed"),
    [
        (b"", "incomplete or not a results.json"),
        (b"\x89MCAP\xff\x00", "not a results.json"),
        (b"[" * 100_000, "not a results.json"),
        (b"[]", 'is not a results.json: "schema" is not'),
        (b'"scaraspec.results/2"', 'is not a results.json: "schema" is not'),
        (b"{}", 'is not a results.json: "schema" is not'),
        (b'{"schema": 1}', 'is not a results.json: "schema" is not'),
        (b'{"schema": "someone.else/1"}', 'is not a results.json: "schema" is not'),
        (b'{"schema": "scaraspec.results/3"}', "has the schema 'scaraspec.results/3'"),
        (b'{"schema": "scaraspec.results/1"}', "damaged: tool is missing"),
        (b'{"schema": "scaraspec.results/1", "tool": NaN}', "not valid JSON"),
        (b'{"schema": ' + b"9" * 5000 + b"}", "not a results.json"),
    ],
)
def test_invalid_files(raw: bytes, printed: str) -> None:
    """Each has its own reason."""
    with pytest.raises(ResultsError) as caught:
        Results.from_json(raw)
    assert printed in str(caught.value)


def test_a_damaged_file(full: Results) -> None:
    """The message has the position of the damage."""
    plain = json.loads(full.to_json())
    plain["cases"][3]["verdict"] = "good"
    with pytest.raises(ResultsError, match=r"damaged: cases\[3\]\.verdict is 'good', not one"):
        Results.from_json(json.dumps(plain))


def test_unreadable_files(tmp_path: Path) -> None:
    """A missing file and a folder; one sentence each."""
    with pytest.raises(ResultsError, match=r"absent\.json cannot be read: No such file"):
        Results.read(tmp_path / "absent.json")
    with pytest.raises(ResultsError, match="cannot be read: Is a directory"):
        Results.read(tmp_path)


def test_a_file_that_is_too_large_is_refused(
    full: Results, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The memory is bounded."""
    path = tmp_path / "results.json"
    full.write(path)
    monkeypatch.setattr(model, "_MAX_FILE_BYTES", path.stat().st_size - 1)
    with pytest.raises(ResultsError, match="too large for results"):
        Results.read(path)


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    """Return the schema that is next to the model, which is a valid JSON Schema."""
    path = Path(model.__file__).with_name("results.schema.json")
    loaded: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(loaded)
    assert loaded["$schema"] == Draft202012Validator.META_SCHEMA["$id"]
    return loaded


def test_written_files_match_the_schema(
    full: Results, hostile: Results, schema: dict[str, Any]
) -> None:
    """The schema allows all values of the model."""
    for results in (full, hostile, replace(full, session=None)):
        Draft202012Validator(schema).validate(json.loads(results.to_json()))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("schema",), "scaraspec.results/3"),
        (("verdict",), "good"),
        (("counts", "good"), 1),
        (("cases", 0, "cause"), "nobody"),
        (("cases", 0, "duration_s"), "1 s"),
        (("cases", 1, "wire", 0), {}),
        (("readings", "controller", "endian", "claimed"), 3),
        (("session", "exchanges", 1, "latency", "bins", 0), [1]),
        (("session", "bytes", "both"), 1),
    ],
)
def test_the_schema_rejects_invalid_values(
    full: Results, schema: dict[str, Any], path: tuple[str | int, ...], value: Any
) -> None:
    """A schema that allows everything would prove nothing."""
    plain = json.loads(full.to_json())
    at: Any = plain
    for step in path[:-1]:
        at = at[step]
    at[path[-1]] = value
    assert not Draft202012Validator(schema).is_valid(plain)


def test_the_schema_names_every_member_of_the_model(schema: dict[str, Any]) -> None:
    """A new member of the model must be added to the schema."""
    complete = {**schema["$defs"], "Results": schema}
    for name, part in complete.items():
        if "properties" in part:
            members = [f.name for f in fields(getattr(model, name))]
            derived = {"schema", "message_template", "message_values"}
            assert [p for p in part["properties"] if p not in derived] == members
    assert schema["title"] == schema["properties"]["schema"]["const"] == SCHEMA


def test_a_message_with_values_keeps_its_template(full: Results) -> None:
    """Programs compare results by template and values; the text may be translated."""
    message = UserMessage("{command} took {time_s:.1f} s", command="jog", time_s=2.04)
    case = replace(full.cases[0], message=message)
    plain = json.loads(replace(full, cases=(case,)).to_json())["cases"][0]
    assert plain["message"] == "jog took 2.0 s"
    assert plain["message_template"] == message.template
    assert plain["message_values"] == {"command": "jog", "time_s": "2.04"}


def test_results_of_schema_1_can_be_read(full: Results) -> None:
    """A file of an earlier version has no attempts, reasons, fingerprints and settings."""
    plain = json.loads(full.to_json())
    plain["schema"] = "scaraspec.results/1"
    del plain["run"], plain["causes"]
    for case in plain["cases"]:
        for key in ("attempts", "reason", "lines", "fingerprint", "step"):
            del case[key]
    read = Results.from_json(json.dumps(plain))
    assert [case.id for case in read.cases] == [case.id for case in full.cases]
    assert read.run is None
    assert [case.step for case in read.cases] == [None] * len(read.cases)
