"""Mode shapes of a test in tables: text with a line for each DOF, one line in all, MATLAB and NumPy arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.files.shape_table import is_shape_table
from femtune.testing import example_deck, example_test

_SHAPES = np.array([[1.0, -0.5], [0.25, np.nan], [0.75, 2.0]])


def _written(folder: Path, text: str, name: str = "shapes.csv") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def _check(test: ft.ModalTest, placed: bool) -> None:
    assert test.modes is not None
    assert test.modes.freq_hz.tolist() == [27.08, 44.7]
    assert test.modes.dofs.labels() == ["3Z+", "12X-", "12RY+"]
    np.testing.assert_array_equal(test.modes.shapes, _SHAPES)
    assert len(test.geometry) == (2 if placed else 0)
    assert len(test.sensors) == (3 if placed else 0)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("placed", [True, False])
def test_a_line_for_each_dof(tmp_path: Path, placed: bool, separator: str) -> None:
    place = [",x,y,z", ",0.1,0,0", ",0.5,0,0.2"] if placed else ["", "", ""]
    text = f"node,direction{place[0]},27.08 Hz,44.7\n3,Z+{place[1]},1.0,-.5\n"
    text += f"12,X-{place[2]},0.25,\n12,RY{place[2]},.75,2\n"
    path = _written(tmp_path, text.replace(",", separator))
    _check(ft.read_test(path, units="m-kg-s"), placed)


def test_labels_in_one_column_and_one_line_in_all(tmp_path: Path) -> None:
    _check(ft.read_test(_written(tmp_path, "dof,27.08Hz,44.7 Hz\n3Z+,1,-.5\n12X-,.25,nan\n12RY+,.75,2\n")), False)
    heads = "f1_hz,f2_hz,shape1_3Z+,shape2_3Z+,shape1_12X-,shape2_12X-,shape1_12RY,shape2_12RY"
    _check(ft.read_test(_written(tmp_path, f"{heads}\n27.08,44.7,1,-.5,.25,,.75,2\n")), False)


@pytest.mark.parametrize("labels", ["cells", "numbers"])
def test_matlab_arrays(tmp_path: Path, labels: str) -> None:
    texts = np.array(["3Z+", "12X-", "12RY+"], dtype=object)
    dofs = texts if labels == "cells" else np.array([[3, 3], [12, 1], [12, 5]])
    shapes = _SHAPES.copy()
    if labels == "numbers":
        shapes[1] *= -1.0
    arrays = {"freq_hz": [27.08, 44.7], "shapes": shapes, "dofs": dofs, "nodes": [3, 12], "xyz": np.eye(3)[:2]}
    savemat(tmp_path / "m.mat", arrays)
    read = ft.read_test(tmp_path / "m.mat")
    if labels == "numbers":
        assert read.modes is not None
        assert read.modes.dofs.labels() == ["3Z+", "12X+", "12RY+"]
        np.testing.assert_array_equal(read.modes.shapes, shapes)
    else:
        _check(read, True)


def test_numpy_arrays(tmp_path: Path) -> None:
    np.savez(tmp_path / "m.npz", freq_hz=[27.08, 44.7], shapes=_SHAPES, dofs=["3Z+", "12X-", "12RY+"])
    _check(ft.read_test(tmp_path / "m.npz"), False)


@pytest.mark.slow
def test_a_table_gives_the_study_of_the_universal_file(tmp_path: Path) -> None:
    test = ft.read_test(example_test(tmp_path))
    assert test.modes is not None
    lines = [",".join(["node,direction,x,y,z", *(f"{f:.6g} Hz" for f in test.modes.freq_hz)])]
    for dof, row in zip(test.modes.dofs, np.real(test.modes.shapes)):
        x, y, z = test.geometry.position(dof.node)
        sign = "+" if dof.sign > 0 else "-"
        lines.append(",".join([str(dof.node), f"{dof.direction}{sign}", *map(repr, map(float, (x, y, z, *row)))]))
    made = ft.init(example_deck(tmp_path), _written(tmp_path, "\n".join(lines)), tmp_path / "new")
    assert made.record.paired == 4
    assert ft.correlate(made.path).pairs.column("mac").round(2).tolist() == [1.0] * 4


_BAD = {
    "test.shapes": "node,direction,27.08 Hz\n",
    "test.shapes, frequency": "node,direction,mode 1\n3,Z+,1\n",
    "test.shapes, fields": "node,direction,27.08 Hz\n3,Z+,1,2\n",
    "test.shapes, number": "node,direction,27.08 Hz\n3,Z+,one\n",
    "test.shapes, label": "node,direction,27.08 Hz\n3,Q+,1\n",
    "test.shapes, place": "node,direction,x,y,z,27.08 Hz\n3,Z+,0,0,0,1\n3,X+,0,0,1,1\n",
    "test.shapes, heading": "f1_hz,shape1_3Z+,weight\n27,1,2\n",
    "test.shapes, lines": "f1_hz,shape1_3Z+\n27,1\n28,1\n",
    "test.shapes, no-frequency": "f1_hz,shape2_3Z+\n27,1\n",
}


@pytest.mark.parametrize("case", _BAD)
def test_mistakes_are_told_with_their_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str) -> None:
    monkeypatch.chdir(tmp_path)
    _written(tmp_path, _BAD[case])
    with pytest.raises(FemtuneError) as caught:
        ft.read_test("shapes.csv")
    check_shown(case, caught.value)


def test_arrays_that_do_not_belong_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    whole = {"freq_hz": [27.08, 44.7], "shapes": _SHAPES, "dofs": ["3Z+", "12X-", "12RY+"]}
    changes = {
        "sizes": {"shapes": _SHAPES.T},
        "points": {"nodes": [3, 12], "xyz": np.eye(2)},
        "dofs": {"dofs": np.array([[3, 9], [12, 1], [12, 5]])},
    }
    for name, change in changes.items():
        np.savez("m.npz", **(whole | change))
        with pytest.raises(FemtuneError) as caught:
            ft.read_test("m.npz")
        check_shown(f"test.shapes, {name}", caught.value)
    np.savez("m.npz", freq_hz=[1.0], shapes=_SHAPES)
    assert is_shape_table(Path("m.npz"))
    with pytest.raises(FemtuneError) as caught:
        ft.read_test("m.npz")
    check_shown("test.shapes, arrays", caught.value)


def test_records_are_no_tables_of_shapes(tmp_path: Path) -> None:
    assert not is_shape_table(_written(tmp_path, "time,acc1,acc2\n0,1,2\n0.1,1,2\n"))
    assert not is_shape_table(example_test(tmp_path))
    assert not is_shape_table(tmp_path / "absent.csv")
