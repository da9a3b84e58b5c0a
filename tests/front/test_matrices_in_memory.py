"""`ft.read_matrices` of arrays: a model without any file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

import femtune as ft

K = np.diag([3e4, 2e4, 2e4, 1e4]) - 1e4 * (np.eye(4, k=1) + np.eye(4, k=-1))
M = np.diag([1.0, 2.0, 1.5, 0.5])
NAMES = ["1Z", "2Z", "3Z", "4Z"]
HZ = np.sqrt(la.eigvalsh(K, M)) / (2 * np.pi)


@pytest.mark.parametrize(
    ("stiffness", "mass", "dofs"),
    [
        (K, M, None),
        (K.tolist(), sp.csr_matrix(M), NAMES),
        (sp.coo_array(K), sp.dia_array(M), [(1, 3), (2, 3), (3, 3), (4, 3)]),
        (sp.triu(K), M, ft.DofSet.parse(["1X+", "1Y-", "2X+", "2Y+"])),
    ],
    ids=["scalar points", "lists", "sparse", "one triangle"],
)
def test_the_frequencies_are_those_of_the_matrices(stiffness: Any, mass: Any, dofs: Any) -> None:
    found = ft.modes(ft.read_matrices(stiffness, mass, dofs=dofs), count=4)
    assert found.freq_hz == pytest.approx(HZ, rel=1e-9)


def test_a_row_along_a_negative_direction_turns_its_shape() -> None:
    plain, turned = (
        ft.modes(ft.read_matrices(K, M, dofs=dofs), count=1).mode_sets["baseline"]
        for dofs in (NAMES, ["1Z", "2Z-", "3Z", "4Z"])
    )
    at = [plain.dofs.labels().index(f"{n}Z+") for n in (1, 2)]
    assert plain.shapes[at, 0].prod() == pytest.approx(-turned.shapes[at, 0].prod(), rel=1e-9)


def test_entries_of_the_coordinate_format_that_stand_twice_are_added() -> None:
    twice = sp.coo_array((np.full(8, 5.0), (np.tile(range(4), 2), np.tile(range(4), 2))), shape=(4, 4))
    found = ft.modes(ft.read_matrices(twice, np.eye(4)), count=1)
    assert found.freq_hz == pytest.approx(np.sqrt(10.0) / (2 * np.pi))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ({"stiffness": K, "mass": M[:3, :3]}, ("'mass'", "(3, 3)", "(4, 4)")),
        ({"stiffness": K[:3], "mass": M}, ("'stiffness'", "(3, 4)", "(3, 3)")),
        ({"stiffness": K, "mass": np.ones(4)}, ("'mass'", "(4,)", "(4, 4)")),
        ({"stiffness": K, "mass": None}, ("'mass'", "NoneType")),
        ({"stiffness": np.full((4, 4), "a"), "mass": M}, ("'stiffness'",)),
        ({"stiffness": K, "mass": M, "dofs": NAMES[:2]}, ("'dofs'", "= 2", "= 4")),
        ({"stiffness": K, "mass": M, "dofs": [1, 2, 3, 4]}, ("'dofs'", "entry = 1")),
        ({"stiffness": K, "mass": M, "dofs": ["1Z", "1Z", "2Z", "3Z"]}, ("1Z+",)),
        ({"stiffness": K + np.eye(4, k=1), "mass": M}, ("not symmetric", "matrix K in memory")),
        ({"stiffness": K * np.nan, "mass": M}, ("not finite",)),
        ({"stiffness": [{"name": "A", "file": K}, {"name": "B", "file": K[:2, :2]}], "mass": M}, ("stiffness[1]",)),
        ({"stiffness": "absent.mtx", "mass": M}, ("absent.mtx",)),
    ],
)
def test_errors_name_the_argument_and_the_shapes(words: dict[str, Any], told: tuple[str, ...]) -> None:
    with pytest.raises(ft.FemtuneError) as error:
        ft.read_matrices(**words)
    assert all(word in str(error.value) for word in told)


def test_other_matrices_have_another_name_in_the_results() -> None:
    assert ft.read_matrices(K, M).path != ft.read_matrices(1.01 * K, M).path


def test_a_parameter_of_a_matrix_is_found_without_files(tmp_path: Path) -> None:
    ground = 1e4 * np.eye(4)
    names: dict[str, Any] = {"dofs": NAMES, "units": "m-kg-s"}
    test = ft.simulate(ft.read_matrices(K + 1.3 * ground, M, **names), [f"{n}+" for n in NAMES], count=4)
    parts = [{"name": "CHAIN", "file": K}, {"name": "GROUND", "file": sp.csc_array(ground)}]
    found = ft.run(
        ft.read_matrices(parts, M, **names),
        test,
        parameters=[ft.Parameter("ground", fields=["MATRIX GROUND"], lower=0.5, upper=2.0)],
        residuals=[ft.FrequencyResidual(sd=0.01)],
        sensors={"by_id": True},
        output=tmp_path / "run",
    )
    assert found.values["ground"] == pytest.approx(1.3, rel=1e-6)
    assert ft.read_results(tmp_path / "run").values["ground"] == pytest.approx(1.3, rel=1e-6)
