"""A model with factors on further fields: the same model, and columns beside differences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.fem import FieldRef
from femtune.files.nastran import build_structure, read_deck
from femtune.judge.regions import mesh_of
from femtune.judge.widened import WideningFactor, widened
from femtune.model import (
    Assignment,
    Configuration,
    ParametricModel,
    configure,
    eigenvalue_derivatives,
    parametric_model,
    solve_modes,
)
from femtune.parameters import Parameter, ParameterSet
from structures.wrong_property import FRAME


@pytest.fixture
def model(tmp_path: Path) -> ParametricModel:
    """The frame with E of all bars as a factor, and I2 of the lower columns in m⁴."""
    path = tmp_path / "frame.bdf"
    path.write_text(FRAME.deck)
    structure = build_structure(read_deck(path)).structure
    parameters = ParameterSet((Parameter("E"), Parameter("I", 1.333e-8, 1e-9, 1e-7)))
    e, i = FieldRef("MAT1", 1, "E"), FieldRef("PBAR", 1, "I2")
    return parametric_model(structure, parameters, [Assignment("E", e), Assignment("I", i, relative=False)])


@pytest.mark.slow
def test_columns(model: ParametricModel) -> None:
    """Of E in two regions, of I2 of a part of the columns, of a spring: beside central differences."""
    E, inertia = FieldRef("MAT1", 1, "E"), FieldRef("PBAR", 1, "I2")
    beam = frozenset(range(101, 106))
    users = frozenset(int(n) for n in model.structure.users(model.structure.values.index(E) or 0))
    factors = [
        WideningFactor("q0", E, beam), WideningFactor("q1", E, users - beam),
        WideningFactor("q2", inertia, frozenset({1})),
        WideningFactor("q3", FieldRef("CELAS2", 901, "K"), frozenset({901})),
    ]  # fmt: skip
    wide = widened(model, factors)
    assert [p.name for p in wide.parameters.free] == ["E", "I", "q0", "q1", "q2", "q3"]
    x = np.array([0.1, -0.2, 0.0, 0.0, 0.0, 0.0])
    configured = configure(wide, Configuration("a"))
    solution = solve_modes(configured.at(x), 5)
    before = solve_modes(configure(model, Configuration("a")).at(x[:2]), 5)
    np.testing.assert_allclose(solution.freq_hz, before.freq_hz, rtol=1e-9)
    slopes, h = eigenvalue_derivatives(solution)[:5], 1e-5
    for j in range(6):
        up, down = (solve_modes(configured.at(x + s * h * np.eye(6)[j]), 5).eigenvalues[:5] for s in (1.0, -1.0))
        np.testing.assert_allclose(slopes[:, j], (up - down) / (2.0 * h), rtol=1e-5, atol=1e-5 * slopes.max())
    # E itself is 1.1, so that a change by 1 of it is one by 1/1.1 of both factors
    np.testing.assert_allclose(slopes[:, 0], (slopes[:, 2] + slopes[:, 3]) / 1.1, rtol=1e-9)


def test_parts_of_a_mesh(model: ParametricModel) -> None:
    """The columns of the lower storey are two pieces; the beam of five bars has halves."""
    mesh = mesh_of(model.structure)
    assert [sorted(p) for p in mesh.divided(frozenset({1, 2, 6, 7}), 2)] == [[1, 2], [6, 7]]
    assert [sorted(p) for p in mesh.divided(frozenset(range(101, 106)), 1)] == [[101, 102], [103, 104, 105]]
    assert list(mesh.divided(frozenset({1, 2}), 2)) == []
