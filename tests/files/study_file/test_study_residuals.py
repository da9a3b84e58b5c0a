"""[[residual]] tables: what is read, and what is refused with a sentence at its line."""

from __future__ import annotations

from pathlib import Path

import pytest

from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.study_file.reading import study_from_text
from femtune.files.study_file.residual import InertiaResidual, MassResidual

HEAD = '[study]\ntitle = "t"\ndeck = "a.bdf"\nunits = "m-kg-s"\n'
TWO = (
    '[[configuration]]\nname = "A"\n[[configuration]]\nname = "B"\n[[configuration]]\nname = "V"\nuse = "validation"\n'
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "a.bdf").touch()
    return tmp_path


def errors_of(folder: Path, text: str) -> list[FemtuneError]:
    with pytest.raises(FemtuneError) as found:
        study_from_text(HEAD + text, folder / "study.toml")
    return list(found.value.errors) if isinstance(found.value, FemtuneErrors) else [found.value]


def test_each_kind_has_a_table_of_its_own(folder: Path):
    text = HEAD + (
        '[[residual]]\nkind = "mass"\nmass = 12.0\nsd = 0.01\n'
        '[[residual]]\nkind = "inertia"\nizz = 3.0\nabout = [0.0, 0.0, 1.0]\nsd = 0.02\n'
    )
    mass, inertia = study_from_text(text, folder / "study.toml").residual
    assert isinstance(mass, MassResidual)
    assert (mass.mass, mass.sd, mass.configuration) == (12.0, 0.01, None)
    assert isinstance(inertia, InertiaResidual)
    assert (inertia.izz, inertia.ixx, inertia.about) == (3.0, None, (0.0, 0.0, 1.0))


REFUSED = {
    "an unknown kind": ('kind = "mas"\nmass = 1.0\nsd = 0.1', "study.value", "'mas' is not a kind of residual"),
    "no kind": ("mass = 1.0", "study.missing-key", "lacks the key 'kind'"),
    "a key of another kind": ('kind = "mass"\nmass = 1.0\nsd = 0.1\nscaling = "mass"', "study.unknown-key", "scaling"),
    "no value": ('kind = "mass"\nsd = 0.1', "study.missing-key", "lacks the key 'mass'"),
    "zero scatter": ('kind = "mac"\nsd = 0.0', "residual.zero-variance", "infinite weight"),
    "no weight": ('kind = "frequency"', "residual.weights", "has neither"),
    "two weights": ('kind = "shape"\nsd = 0.1\ncovariance = [[1.0]]', "residual.weights", "has both"),
    "a covariance that is no square": (
        'kind = "shape"\ncovariance = [[1.0, 2.0]]',
        "study.type",
        "a square matrix of numbers",
    ),
    "a covariance that no test gives": ('kind = "shape"\ncovariance = "test"', "residual.weights", "frequencies only"),
    "no sensors": ('kind = "strain"\nsensors = []\nsd = 0.1', "study.value", "is empty"),
    "no force": (
        'kind = "static-force"\nname = "p"\nforces = {}\ndisplacements = { "1X+" = 0.1 }\nsd = 1.0',
        "study.value",
        "is empty",
    ),
    "a configuration that is not there": (
        'kind = "mac"\nsd = 0.1\nconfiguration = "A"',
        "study.residual-configuration",
        "has no [[configuration]]",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(case: str, folder: Path):
    table, code, words = REFUSED[case]
    found = errors_of(folder, f"[[residual]]\n{table}\n")
    assert [e.code for e in found] == [code]
    assert words in found[0].what
    assert found[0].hint
    assert found[0].where is not None
    assert found[0].where.record.startswith("residual[1]")
    assert found[0].where.line is not None


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", "does not state which one it belongs to"),
        ('configuration = "AA"', "there is no configuration 'AA'"),
        ('configuration = "V"', "used for validation"),
    ],
)
def test_the_configuration_of_a_residual(line: str, words: str, folder: Path):
    found = errors_of(folder, f'{TWO}[[residual]]\nkind = "mac"\nsd = 0.1\n{line}\n')
    assert [e.code for e in found] == ["study.residual-configuration"]
    assert words in found[0].what


def test_nothing_compared_but_by_a_table(folder: Path):
    silent = "[residuals]\nfrequency_sd = 0\n"
    assert [e.code for e in errors_of(folder, silent)] == ["study.nothing-compared"]
    study_from_text(HEAD + silent + '[[residual]]\nkind = "mac"\nsd = 0.1\n', folder / "study.toml")
