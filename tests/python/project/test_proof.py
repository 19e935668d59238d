"""The Coq proof reads its expressions from the source, and compares the functions around them as text: no change of
either goes unnoticed (Coq: `make prove`)."""

import random
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "proof"))

import mutants  # noqa: E402
from cpp import Unknown  # noqa: E402
from extract import write  # noqa: E402
from passages import HOLE, Source, passages  # noqa: E402


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
    rejected, same = 0, []
    for place in places:
        changed, what = mutants.mutant(source, rng, place)
        try:
            if write(changed) == terms:
                same.append(what)
        except Unknown:
            rejected += 1
    assert len(places) > 150 and rejected < len(places) / 2  # most are changes that a compiler would take
    assert same == []


def unnoticed(original, kind, seed):
    """Of one random change at each place of a kind, those that leave the terms as they are."""
    source, terms = original
    rng = random.Random(seed)
    found = []
    for place in mutants.sites(source, kind):
        changed, what = mutants.mutant(source, rng, place, kind)
        try:
            if write(changed) == terms:
                found.append(what)
        except Unknown:
            pass
    return found


def test_any_exchanged_name_is_noticed(original):
    """A name of a function in place of another, types and keywords included."""
    assert len(mutants.sites(original[0], "names")) > 1500
    assert unnoticed(original, "names", 51) == []


def test_any_inserted_statement_is_noticed(original):
    """x = x * 0.5; after each assignment to x."""
    assert len(mutants.sites(original[0], "statements")) > 90
    assert unnoticed(original, "statements", 52) == []


def replaced(original, file, old, new):
    text = original[0].text(file)
    assert text.count(old) == 1
    return mutants.edited(original[0], file, text.index(old), text.index(old) + len(old), new)


@pytest.mark.parametrize(
    "file, old, new, message",
    [
        ("pair_run.h", "(t_b - t_a); if", "(t_b - t_a); D = D * 0.5; if", "frame_D .*something after the end"),
        ("certify.cpp", "; scale =", "; radius = part_a.radius; scale =", "placed_radius .*something after the end"),
        ("certify.cpp", "const double upper", "point.w = point.w * 0.5; const double upper", "the source differs"),
        ("certify.cpp", "T(pair.upper_error())", "T(pair.lower_error())", "placed_upper .*the name pair"),
        (
            "certify.cpp",
            "radius, T(pair.lower_error())",
            "radius, T(pair.upper_error())",
            "placed_lower .*the name pair",
        ),
        ("certify.h", "R * points_b[ib] - D", "R * points_b[ib] - D, D", "placed_cso_vertex .*something after the end"),
        ("certify.h", "T sum = zero;", "bool sum = zero;", "sum is a T, not a bool"),
        ("certify.h", "T sum = zero;", "T sum = zero; T w(0);", "a second w"),
    ],
)
def test_what_once_was_skipped_is_rejected(original, file, old, new, message):
    """Statements after an expression, the other bound's error, tokens left over, types of variables."""
    with pytest.raises(Unknown, match=message):
        write(replaced(original, f"engine/narrow/{file}", old, new))


@pytest.mark.parametrize(
    "file, old, new, message",
    [
        ("vec.h", "norm(const Vec3<T>& a) { using std", "norm(const Vec3<T>& a) { using mine", "expected 'std::sqrt'"),
        ("vec.h", "const T& y, const T& z", "const float& y, const T& z", "expected 'T'"),
        ("vec.h", "Vec3<T>& v) const {", "Vec3<T>& v) const requires(v) {", "no block after"),
        ("arithmetic.h", "double kUnit = 0x1p-53", "int kUnit = 0x1p-53", "kUnit"),
    ],
)
def test_names_types_and_signatures_are_known(original, file, old, new, message):
    with pytest.raises(Unknown, match=message):
        write(replaced(original, f"engine/base/{file}", old, new))


@pytest.mark.parametrize("file, passage", passages())
def test_a_changed_passage_is_rejected(original, file, passage):
    first = HOLE.split(passage)[0].rstrip()
    with pytest.raises(Unknown, match=r"not once.*the source differs"):
        write(replaced(original, file, first, first[:-1] + "?"))


def test_a_change_that_means_nothing_passes(original):
    old, new = "(gap / length - radius)", "((gap / length) - radius)"
    assert write(replaced(original, "engine/narrow/certify.h", old, new)) == original[1]
