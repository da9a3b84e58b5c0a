"""Every value of every card written back, in every format: nothing changes but the characters of its field.

`card_samples` holds the cards and `card_formats` writes them, with the place of each field; neither uses the reader.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.assemble import assemble
from femtune.fem.fields import FieldRef, MatrixKind
from femtune.fem.structure import Structure
from femtune.files.nastran import BuiltDeck, WritePlan, build_structure, parse_real, plan_edits, read_deck, write_deck
from femtune.files.nastran.catalogue import CATALOGUE, PLY_CARDS
from femtune.files.nastran.sections import SHAPES
from femtune.parameters import jet

from .byte_comparison import ENDINGS, PLACES, Variant, WrittenDeck, check_bytes, lay_out, line_of
from .card_formats import COMMENTS, FORMATS
from .card_samples import SAMPLES, Sample

VALUES = (1 / 3, 1.23456789e-12, -4.5e101, 3.0, 12345678.0, -1e-5, 0.0, 98765.4321)
ENDS_MOVE = ("CBAR", "CBEAM")
"""Cards whose values are offsets of ends, which are values only where a parameter names them, and are tested there."""
KINDS: tuple[MatrixKind, ...] = ("stiffness", "mass", "viscous", "hysteretic")


def built_of(deck: WrittenDeck) -> BuiltDeck:
    return build_structure(read_deck(deck.main))


def built_of_main(main: Path) -> Structure:
    return build_structure(read_deck(main)).structure


def texts_of(sample: Sample, name: str, state: str) -> list[str] | None:
    """Texts of the card's fields, those of a value blank, or the card cut before the line where it starts."""
    texts = [one.text for one in sample.fields]
    at = sample.values[name]
    if state == "absent":
        texts = texts[: at[0] - at[0] % 8]
    for index in at:
        if state == "blank":
            texts[index] = ""
    while texts and not texts[-1]:
        texts.pop()
    return texts or None


def matrices(structure: Structure) -> list[np.ndarray]:
    return [assemble(structure, kind).toarray() for kind in KINDS]


def with_value(structure: Structure, ref: FieldRef, value: float) -> Structure:
    """The structure at another value of a field, and at what follows from it."""
    table = structure.values
    index = table.index(ref)
    assert index is not None
    values = table.evaluate({index: jet.constant(value, 0)}, 0).value
    return replace(structure, values=replace(table, values=values))


def check_same(one: Structure, other: Structure) -> None:
    """All that matrices are made of."""
    assert len(one.batches) == len(other.batches)
    for a, b in zip(one.batches, other.batches):
        assert (a.kind, a.ids.tolist(), set(a.roles)) == (b.kind, b.ids.tolist(), set(b.roles))
        for role in a.roles:
            own, others = (s.values.values[batch.roles[role]] for s, batch in ((one, a), (other, b)))
            np.testing.assert_allclose(own, others, rtol=1e-13, atol=0.0, err_msg=role)
        for name in a.facts:
            np.testing.assert_array_equal(a.facts[name], b.facts[name])


def check_same_matrices(one: Structure, other: Structure) -> None:
    for kind, a, b in zip(KINDS, matrices(one), matrices(other)):
        np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-13 * np.abs(a).max(), err_msg=kind)


def sensible(old: float) -> float:
    """A value near by that the card may have, with more digits than a field holds."""
    return old * 31 / 30 if old else 1e-7 / 3


def check_value(deck: WrittenDeck, built: BuiltDeck, ref: FieldRef, value: float, indices: Sequence[int]) -> WritePlan:
    plan = plan_edits(built, {ref: value})
    written = plan.values[ref]
    assert written == pytest.approx(value, rel=6e-3 if abs(value) > 1e100 else 1e-4)
    check_bytes(deck, plan, indices, written)
    for change in plan.edited.changes:
        assert Path(change.where.file) == deck.target
        assert change.where.line == line_of(deck, change.index)
        assert plan.places.get((change.position, change.index), ref) == ref
    return plan


def check_written(deck: WrittenDeck, built: BuiltDeck, ref: FieldRef, folder: Path) -> None:
    """A value that the card may have: the deck that was written is the model at the value that the plan states."""
    index = built.structure.values.index(ref)
    assert index is not None
    plan = check_value(deck, built, ref, sensible(float(built.structure.values.values[index])), places(built, ref))
    new = write_deck(plan.edited, folder)
    if len(built.structure.users(index)):  # what touches nothing cannot be updated in a study
        check_same(built_of_main(new.main), with_value(built.structure, ref, plan.values[ref]))
    check_files(deck, new.main)


def check_files(deck: WrittenDeck, main: Path) -> None:
    """Of files that only lead to the one that changed, no more than paths change."""
    for path, content in deck.files.items():
        assert path.read_bytes() == content
        if path != deck.target:
            new = main if path == deck.main else main.parent / path.name
            blank = [re.sub(rb"(INCLUDE ')[^']*'", rb"\1'", text) for text in (content, new.read_bytes())]
            assert blank[0] == blank[1]


def places(built: BuiltDeck, ref: FieldRef) -> tuple[int, ...]:
    return built.fields[ref].fields


# -- what is combined with what

AXES: tuple[tuple[object, ...], ...] = (tuple(FORMATS), tuple(ENDINGS), tuple(COMMENTS), tuple(PLACES), (False, True))


def pairwise(axes: Sequence[Sequence[object]]) -> list[tuple[object, ...]]:
    """Combinations in which every two choices of two axes meet, found by taking the most useful one first."""

    def pairs(row: Sequence[object]) -> set[tuple[int, object, int, object]]:
        return {(i, row[i], j, row[j]) for i, j in itertools.combinations(range(len(row)), 2)}

    rows = list(itertools.product(*axes))
    open_pairs = set().union(*map(pairs, rows))
    chosen = []
    while open_pairs:
        best = max(rows, key=lambda row: len(pairs(row) & open_pairs))
        chosen.append(best)
        open_pairs -= pairs(best)
    return chosen


@cache
def variants() -> list[Variant]:
    return [Variant(*row) for row in pairwise(AXES)]  # type: ignore[arg-type]


def of_each_form(number: int) -> list[Variant]:
    """One variant of each format; another one for each number."""
    by_form = [[v for v in variants() if v.form == form] for form in FORMATS]
    return [group[(number + i) % len(group)] for i, group in enumerate(by_form)]


def each(numbers: Iterator[int], sample: Sample) -> Iterator[tuple[FieldRef, float]]:
    """Every value of a sample with the next of the odd values."""
    for name in sample.values:
        yield FieldRef(sample.card, sample.number, name), VALUES[next(numbers) % len(VALUES)]


# -- the tests


def test_no_card_is_forgotten() -> None:
    """A card that can be updated has a sample, and each of its values stands in one; so does a ply after the first."""
    most = max(shape.n for shape in SHAPES.values())
    no_shape_has = {f"DIM{i}{end}" for i in range(most + 1, 11) for end in ("", "B")}
    for kind in CATALOGUE.values():
        if kind.name in ENDS_MOVE:
            continue
        named = {name for sample in SAMPLES if sample.card == kind.name for name in sample.values}
        assert all(map(kind.holds, named)), kind.name
        if kind.name in PLY_CARDS:
            assert {"T", "THETA"} <= {name.rstrip("0123456789") for name in named - {"T1", "THETA1"}}
            named = {re.sub(r"^(T|THETA)\d+$", r"\g<1>1", name) for name in named}
        assert named == set(kind.values) - no_shape_has, kind.name


@pytest.mark.slow
def test_pairs_are_complete() -> None:
    rows = [(v.form, v.ending, v.comment, v.place, v.lower) for v in variants()]
    for i, j in itertools.combinations(range(len(AXES)), 2):
        assert {(row[i], row[j]) for row in rows} == set(itertools.product(AXES[i], AXES[j]))


@pytest.mark.quick(6)
@pytest.mark.parametrize("sample", SAMPLES, ids=lambda s: s.name)
def test_values_are_read_where_they_stand(sample: Sample, tmp_path: Path) -> None:
    built = built_of(
        lay_out(sample, [f.text for f in sample.fields], Variant("small", "lf", "none", "main", False), tmp_path)
    )
    for name, indices in sample.values.items():
        ref = FieldRef(sample.card, sample.number, name)
        assert built.fields[ref].fields == indices
        index = built.structure.values.index(ref)
        assert index is not None
        assert built.structure.values.values[index] == parse_real(sample.fields[indices[0]].text)


def check_variant(sample: Sample, variant: Variant, folder: Path, start: int, every: int = 1) -> None:
    """Odd values in every field of a card, and one good value in one of them."""
    deck = lay_out(sample, [f.text for f in sample.fields], variant, folder)
    built = built_of(deck)
    names = list(sample.values)
    for ref, value in each(itertools.count(start), sample):
        check_value(deck, built, ref, value, sample.values[ref.name])
    if start % every == 0:
        name = names[start // every % len(names)]
        check_written(deck, built, FieldRef(sample.card, sample.number, name), folder / "run")


@pytest.mark.quick(0, gate=18)
@pytest.mark.parametrize("sample", SAMPLES, ids=lambda s: s.name)
def test_in_every_format(sample: Sample, tmp_path: Path) -> None:
    for number, variant in enumerate(of_each_form(SAMPLES.index(sample))):
        check_variant(sample, variant, tmp_path / str(number), number + SAMPLES.index(sample))


def fifth(number: int) -> list[Variant]:
    """A fifth of all combinations; another one for the next number."""
    rows = itertools.product(*AXES)
    return [Variant(*row) for row in itertools.islice(rows, number % 5, None, 5)]  # type: ignore[arg-type]


@pytest.mark.long
@pytest.mark.parametrize("sample", SAMPLES, ids=lambda s: s.name)
def test_in_every_combination(sample: Sample, tmp_path: Path) -> None:
    """Eight samples, or more, in each."""
    for number, variant in enumerate(fifth(SAMPLES.index(sample))):
        check_variant(sample, variant, tmp_path / "one", number, 5)


def test_fifths_are_all_combinations_and_each_has_every_pair() -> None:
    fifths = [[(v.form, v.ending, v.comment, v.place, v.lower) for v in fifth(number)] for number in range(5)]
    assert set().union(*fifths) == set(itertools.product(*AXES))
    for i, j in itertools.combinations(range(len(AXES)), 2):
        assert all({(row[i], row[j]) for row in rows} == set(itertools.product(AXES[i], AXES[j])) for rows in fifths)


@pytest.mark.quick(0, gate=20)
@pytest.mark.parametrize("sample", SAMPLES, ids=lambda s: s.name)
def test_matrices_at_each_value(sample: Sample, tmp_path: Path) -> None:
    """The deck that was written has the matrices of the model at the values that the plan states."""
    variant = of_each_form(0)[SAMPLES.index(sample) % len(FORMATS)]
    deck = lay_out(sample, [f.text for f in sample.fields], variant, tmp_path)
    built = built_of(deck)
    updates = {
        ref: sensible(value)
        for ref, value in zip(built.structure.values.refs, built.structure.values.values)
        if ref.card == sample.card and ref.name in sample.values and ref.id == sample.number
    }
    plan = plan_edits(built, updates)
    at_values = built.structure
    for ref in updates:
        at_values = with_value(at_values, ref, plan.values[ref])
    check_same_matrices(built_of_main(write_deck(plan.edited, tmp_path / "run").main), at_values)
    assert len(updates) == len(sample.values)


def buildable(deck: WrittenDeck, ref: FieldRef) -> BuiltDeck | None:
    try:
        built = built_of(deck)
    except FemtuneError:
        return None
    return built if ref in built.fields else None


@pytest.mark.quick(0, gate=40)
@pytest.mark.parametrize("state", ["blank", "absent"])
@pytest.mark.parametrize("sample", SAMPLES, ids=lambda s: s.name)
def test_fields_that_are_not_filled(sample: Sample, state: str, tmp_path: Path) -> None:
    """A blank field, and one whose line the card does not have yet, get a value."""
    check_not_filled(sample, state, 1, tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("state", ["blank", "absent"])
@pytest.mark.parametrize("sample", SAMPLES, ids=lambda s: s.name)
def test_fields_that_are_not_filled_in_every_format(sample: Sample, state: str, tmp_path: Path) -> None:
    check_not_filled(sample, state, len(FORMATS), tmp_path)


def check_not_filled(sample: Sample, state: str, formats: int, tmp_path: Path) -> None:
    left_out = set()
    for number, name in enumerate(sample.values):
        ref = FieldRef(sample.card, sample.number, name)
        texts = texts_of(sample, name, state)
        for form in range(formats):
            forms = of_each_form(number)
            variant = forms[(SAMPLES.index(sample) + number + 5 * form) % len(forms)]
            deck = lay_out(sample, texts, variant, tmp_path / f"{number}-{form}") if texts else None
            built = buildable(deck, ref) if deck else None
            if deck is None or built is None:
                left_out.add(name)
                continue
            check_value(deck, built, ref, VALUES[number % len(VALUES)], places(built, ref))
            check_written(deck, built, ref, tmp_path / f"{number}-{form}" / "run")
    first_line = {name for name, at in sample.values.items() if at[0] < 8}
    needed = set(sample.needed.split())
    assert left_out == (needed | first_line | set(sample.beside.split()) if state == "absent" else needed)


@pytest.mark.slow
@pytest.mark.quick(14, rest="long")
@pytest.mark.parametrize("sample", [s for s in SAMPLES if not s.alone], ids=lambda s: s.name)
def test_a_copy_for_one_of_two_elements(sample: Sample, tmp_path: Path) -> None:
    """A card more behind the one that is shared, and the number of the copy on the element: nothing else changes."""
    for number, name in enumerate(sample.values):
        ref = FieldRef(sample.card, sample.number, name, "part")
        forms = of_each_form(number)
        variant = forms[(SAMPLES.index(sample) + number) % len(forms)]
        deck = lay_out(sample, [f.text for f in sample.fields], variant, tmp_path / str(number))
        built = built_of(deck)
        index = built.structure.values.index(replace(ref, region=""))
        assert index is not None
        value = sensible(float(built.structure.values.values[index]))
        plan = plan_edits(built, {ref: value}, {"part": [11]})
        assert plan.values[ref] == pytest.approx(value, rel=1e-4)
        check_split_bytes(deck, plan)
        new = built_of_main(write_deck(plan.edited, tmp_path / str(number) / "run").main)
        split = built.structure.split(index, [11], "part")
        if len(split.users(index)):
            check_same(new, with_value(split, ref, plan.values[ref]))


def check_split_bytes(deck: WrittenDeck, plan: WritePlan) -> None:
    """Numbers of the new cards are 10 and above; other numbers of properties and materials end at 9."""
    new_lines = rb"((?:\r?\n[^$\r\n]*)+)"
    card_end = deck.start + deck.card.end
    for path, old in deck.files.items():
        new = plan.edited.texts.get(str(path), old.decode("latin-1")).encode("latin-1")
        at = card_end if path == deck.target else len(old)
        before = re.escape(old[:at])
        before = re.sub(rb"(?i)(C[A-Z0-9]*,11),7(?=,)", rb"\1,\\d+", before)
        before = re.sub(
            rb"(?i)(\r?\\\n)((PSHELL|PSOLID),7,9[^\n]*?)(?=\\\r|\\\n)", rb"\1\2(?:\\r?\\n\3,[^$\\r\\n]*)", before
        )
        after = new_lines if path == deck.target else b""
        assert re.fullmatch(before + after + re.escape(old[at:]), new, re.IGNORECASE), (old, new)
