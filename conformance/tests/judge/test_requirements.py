"""The catalogue is complete and well-formed, and is found by id, clause and selection."""

import re
from collections import Counter
from itertools import pairwise

import pytest

from scaraspec.judge.requirements import (
    REQUIREMENTS,
    Basis,
    Binds,
    Method,
    Strength,
    UnknownRequirementError,
    by_clause,
    requirement,
    select,
)
from scaraspec.judge.requirements.catalogue import CATALOGUE
from scaraspec.protocol.hazard import Hazard

LAST_LINE = 1046
REGISTER_ENTRY = re.compile(r"A-(T|[0-8]|4\.[1-9][0-9]?|6\.[1-6][ab]?)-[1-9][0-9]?")
WORD = {Strength.FIRM: "must", Strength.TOLERANT: "should", Strength.INFO: "expected"}


def test_every_requirement_exists_once() -> None:
    """There are 402 requirements with different ids."""
    assert len(CATALOGUE) == 402
    assert tuple(REQUIREMENTS.values()) == CATALOGUE


def test_numbers_of_requirements() -> None:
    """A row that lost or changed a column is found here."""
    assert Counter(r.basis for r in CATALOGUE) == {
        Basis.TEXT: 208,
        Basis.DERIVED: 164,
        Basis.ROBUSTNESS: 30,
    }
    assert Counter(r.strength for r in CATALOGUE) == {
        Strength.FIRM: 322,
        Strength.TOLERANT: 65,
        Strength.INFO: 15,
    }
    assert Counter(r.binds for r in CATALOGUE) == {
        Binds.CONTROLLER: 223,
        Binds.CLIENT: 132,
        Binds.BOTH: 47,
    }
    assert Counter(r.hazard for r in CATALOGUE) == {
        Hazard.READ_ONLY: 133,
        Hazard.STATE: 102,
        Hazard.MOTION: 141,
        Hazard.DESTRUCTIVE: 26,
    }
    assert Counter(method for r in CATALOGUE for method in r.testable) == {
        Method.ACTIVE_CONTROLLER: 243,
        Method.ACTIVE_CLIENT: 132,
        Method.PASSIVE: 318,
        Method.STATIC: 45,
    }


def test_85_requirements_are_read_only() -> None:
    """The default run on hardware needs only these read-only requirements."""
    read_only = [
        r
        for r in CATALOGUE
        if r.hazard is Hazard.READ_ONLY and Method.ACTIVE_CONTROLLER in r.testable
    ]
    assert len(read_only) == 85


def test_clauses_are_contiguous_and_count_from_one() -> None:
    """The numbers of a clause have no gap, and its rows follow each other."""
    numbers: dict[str, list[int]] = {}
    for entry in CATALOGUE:
        numbers.setdefault(entry.clause, []).append(int(entry.id.removeprefix(f"{entry.clause}/")))
    assert len(numbers) == 50
    assert all(counted == list(range(1, len(counted) + 1)) for counted in numbers.values())
    changes = sum(before.clause != after.clause for before, after in pairwise(CATALOGUE))
    assert changes == len(numbers) - 1


def test_lines_are_lines_of_the_document() -> None:
    """Each citation is a line of the document, or a range of more than one line."""
    for entry in CATALOGUE:
        for lines in entry.lines:
            first, last = (lines, lines + 1) if isinstance(lines, int) else lines
            assert 1 <= first < last <= LAST_LINE, entry.id


def test_citations_have_a_quotation() -> None:
    """Only robustness requirements may have no quotation, and each quotation has a line."""
    for entry in CATALOGUE:
        assert bool(entry.original) == bool(entry.lines), entry.id
        assert entry.lines or entry.basis is Basis.ROBUSTNESS, entry.id
        quotes = entry.original.split(" / ") if entry.lines else []
        assert all(quote and quote == quote.strip() for quote in quotes), entry.id


def test_citations_of_the_register() -> None:
    """Each requirement cites at least one entry of the register, in the right form."""
    for entry in CATALOGUE:
        assert entry.register, entry.id
        assert all(REGISTER_ENTRY.fullmatch(name) for name in entry.register), entry.id


def test_only_firm_sentences_contain_must() -> None:
    """A firm sentence contains "must", and no other sentence does."""
    for entry in CATALOGUE:
        words = set(re.findall(r"\w+", entry.sentence))
        assert WORD[entry.strength] in words, entry.id
        assert entry.strength is Strength.FIRM or "must" not in words, entry.id
        assert entry.sentence.endswith("."), entry.id


def test_cases_test_the_bound_side() -> None:
    """Active cases for controllers bind controllers, cases for clients or their files bind
    clients."""
    for entry in CATALOGUE:
        if Method.ACTIVE_CONTROLLER in entry.testable:
            assert entry.binds is not Binds.CLIENT, entry.id
        if entry.testable & (Method.ACTIVE_CLIENT | Method.STATIC):
            assert entry.binds is not Binds.CONTROLLER, entry.id


def test_a_citation_reads_as_it_is_written_in_reports() -> None:
    """A range has a dash, lists have a comma, and no lines give an empty text."""
    assert requirement("4.16/2").where == "L337-342"
    assert requirement("4.3/4").where == "L153, L98"
    assert requirement("2/13").where == ""


def test_a_requirement_is_found_by_its_id() -> None:
    """The first half of an id is the clause."""
    found = requirement("4.15/3")
    assert found is REQUIREMENTS["4.15/3"]
    assert found.clause == "4.15"
    assert found.original == "0xCC | 0x30 | 4 | “0 11” | 0xAA"


def test_an_unknown_requirement_suggests_similar_ids() -> None:
    """The message suggests similar ids."""
    with pytest.raises(UnknownRequirementError, match=r"no requirement '4\.15/33'.*4\.15/3"):
        requirement("4.15/33")


@pytest.mark.parametrize("name", ["A" * 1_000_000, "4.15/" + "3" * 1_000_000, "\x1b[2J"])
def test_a_hostile_name_gives_a_short_printable_message(name: str) -> None:
    """A long name or one with control characters gives a short printable message."""
    with pytest.raises(UnknownRequirementError) as caught:
        select(name)
    message = str(caught.value)
    assert len(message) < 120
    assert message.isprintable()


@pytest.mark.parametrize(
    ("prefix", "clauses"),
    [
        ("4.1", {"4.1"}),
        ("4.15", {"4.15"}),
        ("T", {"T"}),
        ("6.6", {"6.6a", "6.6b"}),
        ("6.6a", {"6.6a"}),
        ("6", {"6.1", "6.2", "6.3", "6.4", "6.5", "6.6a", "6.6b"}),
    ],
)
def test_a_clause_is_found_with_its_subclauses(prefix: str, clauses: set[str]) -> None:
    """Numbers are matched whole: 4.1 is not 4.15."""
    found = by_clause(prefix)
    assert {r.clause for r in found} == clauses
    assert found == tuple(r for r in CATALOGUE if r.clause in clauses)


@pytest.mark.parametrize("prefix", ["", "4.", "4.29", "9", "4.15/3", "t"])
def test_an_unknown_clause_is_an_error(prefix: str) -> None:
    """An empty selection would look like a run without failures."""
    with pytest.raises(UnknownRequirementError):
        by_clause(prefix)


def test_a_selection_mixes_clauses_and_requirements() -> None:
    """Each requirement is selected once, in the order of the document, however it was named."""
    assert [r.id for r in select("4.22, 4.21/6,2/13,4.22/1")] == [
        "2/13",
        "4.21/6",
        "4.22/1",
        "4.22/2",
    ]


@pytest.mark.parametrize("selection", ["", "4.15,", "4.15,,2", "4.15;2", "4.15/", "/3", "all"])
def test_a_selection_with_an_unknown_item_is_an_error(selection: str) -> None:
    """One unknown item makes the whole selection an error."""
    with pytest.raises(UnknownRequirementError):
        select(selection)
