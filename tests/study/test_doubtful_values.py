"""Values of a study that no structure or test has are told by `check`, usual values are not."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from femtune.steps.check.run import check_study
from femtune.steps.problem import FoundProblem
from femtune.testing import example_deck, example_test

HEAD = '[study]\ntitle = "x"\ndeck = "{deck}"\nunits = "m-kg-s"\n'
TEST = '[test]\nfile = "{test}"\n'
PARAMETER = '[[parameter]]\nname = "p"\nfields = ["{field}"]\nlower = {lower}\nupper = {upper}\n'
CODES = {
    "parameter.meaningless-bound", "study.large-length", "study.large-angle", "study.damping-doubtful",
    "study.large-sd", "study.heavy-masses", "test.damping-doubtful", "deck.negative-value", "model.mass-differs",
}  # fmt: skip


def problems(folder: Path, text: str, **more: str) -> list[FoundProblem]:
    """What `check` finds in the example with some tables."""
    facts = {"deck": example_deck(folder).name, "test": example_test(folder).name, **more}
    rest = text if "[test]" in text or "[[configuration]]" in text else TEST + text
    (folder / "study.toml").write_text((HEAD + rest).format(**facts))
    return list(check_study(folder / "study.toml").record.problems)


def told(found: list[FoundProblem]) -> Iterator[FoundProblem]:
    assert not [p for p in found if p.level == "error"]
    yield from (p for p in found if p.code in CODES)


def bounds(field: str, lower: str, upper: str, more: str = "") -> str:
    return PARAMETER.replace("{field}", field).replace("{lower}", lower).replace("{upper}", upper) + more


FOUND = {
    "modulus, bounds in percent": (bounds("MAT1 1 E", "-20", "20"), "write lower = 0.8, upper = 1.2"),
    "density may vanish": (bounds("MAT1 1 RHO", "0.0", "2.0"), "the elements then have no stiffness or no mass"),
    "area below zero": (bounds("PBAR 1 A", "-0.5", "1.5"), "it must not be negative"),
    "modulus itself below zero": (
        bounds("MAT1 1 E", "-1e9", "4e11", "absolute = true\n"), "MAT1 1 E is -1e+09: it must not be negative"
    ),
    "damping ratio of 150 %": (
        bounds("MODAL ZETA", "0.1", "2.0", "absolute = true\nnominal = 1.5\n"), "a fraction, not a percentage"
    ),
    "position in millimetres": ("[sensors]\nposition_sd = 5.0\n", "position_sd = 5"),
    "tolerance in millimetres": ("[sensors]\ntolerance = 50.0\n", "tolerance = 50"),
    "angle of 180°": ("[sensors]\nangle_sd_deg = 180.0\n", "angle_sd_deg = 180"),
    "deviation of 100 %": ("[residuals]\nfrequency_sd = 1.0\n", "100 % of each frequency"),
    "shapes of 100 %": ("[residuals]\nshape_sd = 1.0\n", "100 % of the largest entry"),
    "prior in percent": (bounds("MAT1 1 E", "0.5", "2.0", "mean = 1.0\nsd = 10.0\n"), "write 0.1"),
    "response of 50 % damping": ("[response]\nratio = 0.5\n", "if 0.5 % is meant, write 0.005"),
    "heavy masses": (
        '[[configuration]]\nname = "a"\ntest = "{test}"\nmasses = [{{ node = 2, mass = 2000.0 }}]\n',
        "the added masses (2000 in all, 2000 at grid point 2)",
    ),
    "weighed in grams": ('[[configuration]]\nname = "a"\ntest = "{test}"\nweighed_mass = 90000.0\n', "measured mass"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", FOUND)
def test_doubtful_values_are_told(tmp_path: Path, name: str) -> None:
    text, words = FOUND[name]
    (problem,) = told(problems(tmp_path, text))
    assert words in problem.message
    assert problem.level == "warning"


SOUND = {
    "factors": bounds("MAT1 1 E", "0.001", "5.0"),
    "values": bounds("MAT1 1 E", "1e9", "4e11", "absolute = true\n"),
    "damping that may vanish": bounds("MODAL ZETA", "0.0", "0.1", "absolute = true\nnominal = 0.01\n"),
    "sensors": "[sensors]\nposition_sd = 0.005\nangle_sd_deg = 3.0\ntolerance = 0.05\n",
    "deviations": "[residuals]\nfrequency_sd = 0.05\nshape_sd = 0.2\n",
    "response": "[response]\nratio = 0.07\n",
    "masses": '[[configuration]]\nname = "a"\ntest = "{test}"\nmasses = [{{ node = 2, mass = 0.5 }}]\n',
}


@pytest.mark.quick(0)
@pytest.mark.parametrize("name", SOUND)
def test_usual_values_say_nothing(tmp_path: Path, name: str) -> None:
    assert not list(told(problems(tmp_path, SOUND[name])))


def test_doubts_of_deck_and_test_are_told_beside_errors_of_the_study(tmp_path: Path) -> None:
    """An error of one table does not hide what is doubtful in the deck."""
    deck = example_deck(tmp_path)
    lines = deck.read_text().splitlines()
    (tmp_path / "heavy.bdf").write_text("\n".join([*lines[:-1], "CONM2,99001,2,,-3.", lines[-1]]) + "\n")
    found = problems(tmp_path, bounds("MAT1 77 E", "0.5", "2.0"), deck="heavy.bdf")
    assert [p.code for p in found if p.level == "error"] == ["study.unknown-field"]
    assert any("CONM2 99001 M is negative (-3)" in p.message for p in found)
