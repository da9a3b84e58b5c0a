"""A study whose test is described by an identification file, or is in several files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import femtune as ft
from femtune.files.uff import read_uff
from femtune.study.study import load_study
from femtune.testing import example_deck, example_test
from femtune.units import SI


def responded(tmp_path: Path) -> ft.FrfSet:
    lines = {"from_hz": 5.0, "to_hz": 60.0, "step_hz": 0.5, "ratio": 0.01}
    deck = example_deck(tmp_path)
    ft.respond(deck, inputs=["5Z+"], outputs=["3Z+", "5Z+"], uff=tmp_path / "f.uff", units="m-kg-s", **lines)
    frfs = read_uff(tmp_path / "f.uff", units=SI).test.frfs
    assert frfs is not None
    return frfs


def study_of(folder: Path, files: str) -> Path:
    head = f'[study]\ntitle = "Test in files"\ndeck = "{example_deck(folder).name}"\nunits = "m-kg-s"\n'
    (folder / "study.toml").write_text(f"{head}[test]\nfile = {files}\n")
    return folder / "study.toml"


def test_functions_of_a_matlab_file_are_compared_like_those_of_a_universal_file(tmp_path: Path) -> None:
    frfs = responded(tmp_path)
    savemat(tmp_path / "frf.mat", {"test": {"H": frfs.values.transpose(2, 0, 1), "f": frfs.freq_hz}})
    geometry = read_uff(tmp_path / "f.uff", units=SI).test.geometry
    rows = (f"{n}," + ",".join(f"{x:.9g}" for x in geometry.position(n)) for n in geometry.nodes)
    (tmp_path / "points.csv").write_text("node,x,y,z\n" + "\n".join(rows) + "\n")
    (tmp_path / "test.toml").write_text(
        f'[identify]\nfrfs = "frf.mat"\ngeometry = "points.csv"\n[functions]\nkind = "{frfs.kind}"\n'
        'variable = "test.H"\nfrequency = "test.f"\nresponses = ["3Z+", "5Z+"]\nreferences = ["5Z+"]\n'
    )
    found = {}
    for name in ("f.uff", "test.toml"):
        test = load_study(study_of(tmp_path, f'"{name}"')).cases[0].test
        assert test is not None
        assert test.frfs is not None
        found[name] = test
    assert found["test.toml"].frfs.values == pytest.approx(found["f.uff"].frfs.values)
    assert [str(s.label) for s in found["test.toml"].sensors] == [str(s.label) for s in found["f.uff"].sensors]


def test_modes_and_functions_in_two_files(tmp_path: Path) -> None:
    responded(tmp_path)
    modes = example_test(tmp_path)
    found = ft.correlate(study_of(tmp_path, f'["{modes.name}", "f.uff"]'))
    assert len(found.pairs) > 0
    assert min(row["mac"] for row in found.pairs) > 0.99


@pytest.mark.slow
def test_lines_of_a_second_file_are_added_by_identification_and_study(tmp_path: Path) -> None:
    """Of a range that the first file has, its lines alone are used."""
    responded(tmp_path)
    lines = {"from_hz": 2.0, "to_hz": 10.0, "step_hz": 0.25, "ratio": 0.01}
    deck = tmp_path / example_deck(tmp_path).name
    ft.respond(deck, inputs=["5Z+"], outputs=["3Z+", "5Z+"], uff=tmp_path / "low.uff", units="m-kg-s", **lines)
    (tmp_path / "test.toml").write_text('[identify]\nfrfs = ["f.uff", "low.uff"]\nlargest_order = 12\n')
    expected = np.concatenate([np.arange(2.0, 5.0, 0.25), np.arange(5.0, 60.5, 0.5)])
    for files in ('"test.toml"', '["f.uff", "low.uff"]'):
        test = load_study(study_of(tmp_path, files)).cases[0].test
        assert test is not None
        assert test.frfs is not None
        complete = np.isfinite(test.frfs.values).all(axis=(0, 1))
        np.testing.assert_allclose(test.frfs.freq_hz[complete], expected)
        assert "test.joined-frfs" in {n.code for n in test.notices}
    identified = ft.identify(tmp_path / "test.toml", output=tmp_path / "identified")
    assert len(identified.modes) >= 1
