"""The Coq proof reads its expressions from the source: no change of these goes unnoticed (Coq: `make prove`)."""

import random
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "proof"))

import mutants  # noqa: E402
from cpp import Unknown  # noqa: E402
from extract import write  # noqa: E402
from passages import PASSAGES, Source  # noqa: E402


@pytest.fixture(scope="module")
def original():
    source = Source(ROOT)
    return source, write(source)


def test_every_tied_expression_is_extracted_and_compared(original):
    """Tie.v compares each definition that the extraction writes."""
    names = [line.split()[1] for line in original[1].splitlines() if line.startswith("Definition ")]
    tie = (ROOT / "proof/Tie.v").read_text()
    assert len(names) > 30
    assert [name for name in names if f"Lemma {name}_tied" not in tie and name not in ("difference", "sum")] == []


def test_any_changed_operation_or_constant_changes_the_terms(original):
    """At each place, one random change: the extraction rejects it, or writes other terms."""
    source, terms = original
    places = mutants.sites(source)
    rng = random.Random(50)
    rejected, unnoticed = 0, []
    for place in places:
        changed, what = mutants.mutant(source, rng, place)
        try:
            if write(changed) == terms:
                unnoticed.append(what)
        except Unknown:
            rejected += 1
    assert len(places) > 150 and rejected < len(places) / 2  # most are changes that a compiler would take
    assert unnoticed == []


@pytest.mark.parametrize("file, passage", PASSAGES)
def test_a_changed_passage_is_rejected(original, file, passage):
    source = Source(ROOT)
    text = original[0].text(file)
    source.texts = {**original[0].texts, file: text.replace(passage, passage[:-1] + " ;")}
    with pytest.raises(Unknown, match="not once"):
        write(source)


def test_a_change_that_means_nothing_passes(original):
    source = Source(ROOT)
    file = "engine/narrow/certify.h"
    text = original[0].text(file)
    assert text.count("(gap / length - radius)") == 1
    source.texts = {**original[0].texts, file: text.replace("(gap / length - radius)", "((gap / length) - radius)")}
    assert write(source) == original[1]
