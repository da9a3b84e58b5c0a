"""What is written is read back, by this package and by pyuff."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyuff
from small_case import DOFS, sample_frame, sample_modes, sample_shapes, sample_test, turned_axes

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.files.uff import read_uff, write_uff_modes
from femtune.modal import ModeSet
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI, unit_system


def assert_same(found: ModalTest, wanted: ModalTest) -> None:
    assert found.modes is not None
    assert wanted.modes is not None
    assert found.modes.dofs == wanted.modes.dofs
    assert found.modes.labels == wanted.modes.labels
    assert found.modes.normalisation == wanted.modes.normalisation
    np.testing.assert_array_equal(found.modes.shapes, wanted.modes.shapes)
    np.testing.assert_array_equal(found.modes.freq_hz, wanted.modes.freq_hz)
    np.testing.assert_array_equal(found.modes.damping_ratio, wanted.modes.damping_ratio)
    np.testing.assert_array_equal(found.geometry.nodes, wanted.geometry.nodes)
    np.testing.assert_array_equal(found.geometry.coordinates, wanted.geometry.coordinates)
    np.testing.assert_allclose(np.asarray(found.geometry.axes), np.asarray(wanted.geometry.axes), atol=1e-15)
    assert found.geometry.lines == wanted.geometry.lines
    assert found.geometry.elements == wanted.geometry.elements
    assert [s.label for s in found.sensors] == [s.label for s in wanted.sensors]


def test_read_back_identically(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    write_uff_modes(path, sample_test(), ["a title"])
    content = read_uff(path, units=SI)
    assert_same(content.test, sample_test())
    assert content.test.name == "a"
    assert content.mode_records[0].id_lines == ("BC", "a title", "NONE", "NONE", "NONE")
    assert [n.code for n in content.notices] == ["uff.not-measured"]
    assert "4 of 9" in content.notices[0].what


def test_local_axes_become_directions_of_sensors(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    write_uff_modes(path, sample_test())
    directions = {str(s.label): s.direction for s in read_uff(path, units=SI).test.sensors}
    assert directions["7X+"] == pytest.approx([0, 1, 0])
    assert directions["1X+"] == pytest.approx([1, 0, 0])


def test_pyuff_reads_it(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    write_uff_modes(path, sample_test())
    file = pyuff.UFF(str(path))
    assert file.get_set_types().tolist() == [164, 2420, 2411, 82, 2412, 55, 55]
    sets = file.read_sets()
    assert sets[0]["length"] == 1.0
    assert sets[2]["node_nums"].tolist() == [1, 2, 7]
    assert sets[2]["x"][1] == 1.0 / 3.0
    assert sets[2]["disp_cs"].tolist() == [0, 0, 2]
    np.testing.assert_array_equal(sets[1]["CS_matrices"][0][:3], turned_axes()[2])
    assert sets[3]["nodes"].tolist() == [1, 2, 7]
    assert sets[4]["triangle"]["nodes_nums"] == [[1, 2, 7]]
    assert sets[4][21][0]["nodes_nums"] == [1, 2]
    assert (sets[6]["freq"], sets[6]["mode_n"], sets[6]["modal_damp_vis"]) == (11.0625, 4, 0.0225)
    np.testing.assert_array_equal(sets[6]["r1"], [-0.25, 0.0, 2.5])
    np.testing.assert_array_equal(sets[5]["r2"], [0.0, -0.123456, 0.0])


def test_complex_shapes(tmp_path: Path) -> None:
    shapes = sample_shapes() + 1j * sample_shapes()[::-1]
    path = tmp_path / "a.uff"
    write_uff_modes(path, sample_test(sample_modes(shapes)))
    found = read_uff(path, units=SI).test.modes
    assert found is not None
    np.testing.assert_allclose(found.shapes, shapes, rtol=1e-5)
    assert found.freq_hz == pytest.approx([3.25, 11.0625], rel=1e-5)
    assert found.damping_ratio == pytest.approx([0.01, 0.0225], rel=1e-4)
    assert pyuff.UFF(str(path)).read_sets(5)["eig"].imag == pytest.approx(2 * np.pi * 3.25, rel=1e-3)


@pytest.mark.parametrize("factor", [1.0, 1.0 + 2.0j])
def test_rotations(tmp_path: Path, factor: complex) -> None:
    """Six values a node, real and complex (twelve numbers, two lines)."""
    dofs = DofSet.parse(["1X+", "1RZ+", "2RX+"])
    shapes = np.array([[1.0], [0.5], [-0.25]]) * factor
    modes = ModeSet(np.array([3.0]), shapes, dofs)
    path = tmp_path / "a.uff"
    write_uff_modes(path, ModalTest("a", SI, sample_frame(), modes=modes))
    found = read_uff(path, units=SI).test
    assert found.modes is not None
    assert found.modes.dofs == dofs
    np.testing.assert_allclose(found.modes.shapes, shapes, rtol=1e-5)
    assert found.sensors[1].is_rotation


def test_signs_are_taken_into_the_values(tmp_path: Path) -> None:
    dofs = DofSet.parse(["1X-", "2Z+"])
    path = tmp_path / "a.uff"
    modes = ModeSet(np.array([3.0]), np.array([[1.0], [2.0]]), dofs)
    write_uff_modes(path, ModalTest("a", SI, modes=modes))
    found = read_uff(path, units=SI).test.modes
    assert found is not None
    assert found.dofs.labels() == ["1X+", "2Z+"]
    assert found.select_dofs(dofs).shapes[:, 0].tolist() == [1.0, 2.0]


def test_configurations_by_word(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    other = sample_test(sample_modes(2 * sample_shapes()), "SC")
    write_uff_modes(path, [sample_test(), other], ["building"])
    assert_same(read_uff(path, units=SI, records="BC").test, sample_test())
    found = read_uff(path, units=SI, records="SC").test
    assert found.name == "SC"
    assert_same(found, other)
    with pytest.raises(FemtuneError) as caught:
        read_uff(path, units=SI)
    assert caught.value.code == "uff.repeated-mode"
    for word in ("C", "bc", "B.", "NC"):
        with pytest.raises(FemtuneError) as caught:
            read_uff(path, units=SI, records=word)
        assert caught.value.code == "uff.no-record"
        assert "BC | building" in str(caught.value)


def test_units_of_the_file_are_converted(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    write_uff_modes(path, sample_test())
    test = read_uff(path, units=unit_system("mm-t-s")).test
    assert test.geometry.position(7) == pytest.approx([-1500.0, 2000.0, 1.0])
    assert test.modes is not None
    np.testing.assert_allclose(test.modes.shapes, np.sqrt(1000) * sample_shapes(), rtol=1e-12)
    assert read_uff(path, units=SI, file_units=SI).file_units.length == 1.0
    with pytest.raises(FemtuneError) as caught:
        read_uff(path, units=SI, file_units=unit_system("mm-kg-s"))
    assert caught.value.code == "uff.units-contradict"


def nan_modes() -> ModeSet:
    shapes = sample_shapes()
    shapes[1, 1] = np.nan
    return sample_modes(shapes)


def zero_modes() -> ModeSet:
    return sample_modes(sample_shapes() * np.array([[1.0], [1.0], [0.0], [1.0], [1.0]]))


CANNOT = {
    "no modes": ModalTest("a", SI),
    "single NaN": sample_test(nan_modes()),
    "zero row": sample_test(zero_modes()),
    "label": sample_test(replace(sample_modes(), labels=("1", "2a"))),
    "long name": sample_test(name="x" * 81),
    "line break": sample_test(name="a\nb"),
    "scalar point": ModalTest("a", SI, modes=ModeSet(np.array([1.0]), np.ones((2, 1)), DofSet.parse(["1S+", "2X+"]))),
}


@pytest.mark.parametrize("case", CANNOT)
def test_refuses_what_the_format_cannot_hold(tmp_path: Path, case: str) -> None:
    path = tmp_path / "a.uff"
    with pytest.raises(FemtuneError) as caught:
        write_uff_modes(path, CANNOT[case])
    assert caught.value.code == "uff.cannot-write"
    assert not path.exists()


def test_refuses_different_geometries_and_unwritable_files(tmp_path: Path) -> None:
    moved = WireFrame(np.array([1]), np.ones((1, 3)))
    other = replace(sample_test(name="SC"), geometry=moved, sensors=())
    for path, tests in (
        (tmp_path / "a.uff", [sample_test(), other]),
        (tmp_path / "none" / "a.uff", [sample_test()]),
    ):
        with pytest.raises(FemtuneError) as caught:
            write_uff_modes(path, tests)
        assert caught.value.code == "uff.cannot-write"


def test_a_file_of_another_kind_is_not_replaced(tmp_path: Path) -> None:
    deck = tmp_path / "model.bdf"
    deck.write_text("BEGIN BULK\nENDDATA\n")
    with pytest.raises(FemtuneError) as caught:
        write_uff_modes(deck, [sample_test()])
    assert caught.value.code == "uff.cannot-write"
    assert deck.read_text() == "BEGIN BULK\nENDDATA\n"


def test_a_universal_file_is_replaced_and_a_link_not_written_through(tmp_path: Path) -> None:
    behind, path = tmp_path / "behind.uff", tmp_path / "a.uff"
    behind.write_text("    -1\n   164\n    -1\n")
    path.symlink_to(behind)
    write_uff_modes(path, [sample_test()])
    assert behind.read_text() == "    -1\n   164\n    -1\n"
    assert not path.is_symlink()
    assert read_uff(path, units=SI).test.modes is not None


def test_sample_has_what_it_says() -> None:
    assert len(DOFS) == len(sample_shapes())


def test_oblique_directions_of_sensors_are_read_back(tmp_path: Path) -> None:
    """Axes that are no triad: one measured direction, two perpendicular ones, two and three oblique ones."""
    rng = np.random.default_rng(3)
    skew = rng.standard_normal((5, 3, 3))
    skew /= np.linalg.norm(skew, axis=2, keepdims=True)
    skew[1, 2] = np.cross(skew[1, 0], [0.0, 0.0, 1.0])
    skew[1, 2] /= np.linalg.norm(skew[1, 2])
    skew[4] = -np.eye(3)
    dofs = DofSet.parse(["1Y+", "2X+", "2Z-", "3X+", "3Y+", "4X+", "4Y-", "4Z+", "5X+", "5Y+", "5Z+"])
    modes = ModeSet(np.array([3.0]), rng.standard_normal((len(dofs), 1)), dofs)
    frame = WireFrame(np.arange(1, 6), rng.standard_normal((5, 3)), skew)
    write_uff_modes(tmp_path / "a.uff", ModalTest("a", SI, frame, (), modes))
    found = read_uff(tmp_path / "a.uff", units=SI).test.geometry
    assert found.axes is not None
    for dof in dofs:
        np.testing.assert_allclose(found.direction(dof), frame.direction(dof), atol=1e-14)
    names = next(s for s in pyuff.UFF(str(tmp_path / "a.uff")).read_sets() if s["type"] == 2420)["CS_names"]
    assert names == ["CS2", "CS3", *3 * ["OBLIQUE SENSOR DIRECTIONS"]]


def test_oblique_axes_that_are_not_declared_are_refused(tmp_path: Path) -> None:
    skew = np.array([[[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]])
    modes = ModeSet(np.array([3.0]), np.ones((2, 1)), DofSet.parse(["1X+", "1Y+"]))
    path = tmp_path / "a.uff"
    write_uff_modes(path, ModalTest("a", SI, WireFrame(np.array([1]), np.zeros((1, 3)), skew), (), modes))
    path.write_text(path.read_text().replace("OBLIQUE SENSOR DIRECTIONS", "CS2"))
    with pytest.raises(FemtuneError, match="right-handed triad"):
        read_uff(path, units=SI)


@pytest.mark.parametrize("factor", [1.0, 1.0 + 0.5j])
def test_modes_of_scalar_points_are_read_back(tmp_path: Path, factor: complex) -> None:
    modes = ModeSet(np.array([3.0, 5.0]), factor * np.array([[1.0, 0.5], [-0.25, 2.0]]), DofSet.parse(["4S+", "9S-"]))
    write_uff_modes(tmp_path / "a.uff", ModalTest("a", SI, sample_frame(), (), modes))
    found = read_uff(tmp_path / "a.uff", units=SI)
    assert found.test.modes is not None
    assert found.test.modes.dofs == DofSet.parse(["4S+", "9S+"])
    np.testing.assert_allclose(found.test.modes.shapes, modes.shapes * [[1.0], [-1.0]], rtol=1e-5)
    assert not [n for n in found.notices if n.code == "uff.no-position"]
