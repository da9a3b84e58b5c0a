"""FRFs as Universal Files: read back by our reader and by pyuff."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyuff
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.files.uff import read_uff, write_uff_frfs
from femtune.modal import FrfSet
from femtune.modal.frf_set import KINDS
from femtune.testdata import ModalTest, WireFrame
from femtune.units import force_unit, unit_system

_RESPONSES, _REFERENCES = DofSet.parse(["1X+", "2RX-", "30S+"]), DofSet.parse(["1X-", "2RY+"])
_LINES = [np.arange(1, 100) / 3.0, np.array([0.0, 1.0, 2.5, 7.123456789]), np.array([5.0]), np.linspace(0, 1e5, 7)]


def _test(freq_hz: NDArray, kind: str = "accelerance", units: str = "m-kg-s") -> ModalTest:
    rng = np.random.default_rng(1)
    shape = (len(_RESPONSES), len(_REFERENCES), len(freq_hz))
    values = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) * 1e-7
    frame = WireFrame(np.array([1, 2, 30]), np.arange(9.0).reshape(3, 3))
    return ModalTest("plate", unit_system(units), frame, frfs=FrfSet(freq_hz, values, _RESPONSES, _REFERENCES, kind))


@pytest.mark.quick(16)
@pytest.mark.parametrize("units", ["m-kg-s", "mm-t-s", "mm-kg-s", "in-slinch-s", "ft-lbm-s", "cm-g-s"])
@pytest.mark.parametrize("freq_hz", _LINES)
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_is_read_back(tmp_path: Path, units: str, freq_hz: NDArray, kind: str) -> None:
    test = _test(freq_hz, kind, units)
    content = read_uff(write_uff_frfs(tmp_path / "a.uff", test), units=test.units)
    found, given = content.test.frfs, test.frfs
    assert found is not None
    assert given is not None
    assert (found.kind, found.responses, found.references) == (kind, _RESPONSES, _REFERENCES)
    np.testing.assert_allclose(found.values, given.values, rtol=0, atol=1e-12 * np.abs(given.values).max())
    np.testing.assert_allclose(found.freq_hz, freq_hz, rtol=1e-9)
    assert not content.notices
    np.testing.assert_allclose(content.test.geometry.coordinates, test.geometry.coordinates, rtol=1e-15)


def test_another_program_reads_it(tmp_path: Path) -> None:
    test = _test(_LINES[0])
    path = write_uff_frfs(tmp_path / "a.uff", test)
    assert test.frfs is not None
    sets = [s for s in pyuff.UFF(str(path)).read_sets() if s["type"] == 58]
    assert [(s["rsp_node"], s["rsp_dir"], s["ref_node"], s["ref_dir"]) for s in sets[:3]] == [
        (1, 1, 1, -1), (2, -4, 1, -1), (30, 0, 1, -1),
    ]  # fmt: skip
    np.testing.assert_allclose(sets[1]["data"], test.frfs.values[1, 0], rtol=1e-11)
    np.testing.assert_allclose(sets[1]["x"], test.frfs.freq_hz, rtol=1e-9)
    axes = [(s["ordinate_spec_data_type"], s["ordinate_axis_units_lab"], s["orddenom_axis_units_lab"]) for s in sets]
    assert axes[0] == (12, "m/s2", "N")
    assert axes[4] == (12, "rad/s2", "N.m")


def test_functions_that_were_not_measured_are_left_out(tmp_path: Path) -> None:
    test = _test(_LINES[0])
    assert test.frfs is not None
    values = test.frfs.values.copy()
    values[1, 1] = np.nan
    frfs = FrfSet(test.frfs.freq_hz, values, _RESPONSES, _REFERENCES, "mobility")
    path = write_uff_frfs(tmp_path / "a.uff", ModalTest("a", test.units, test.geometry, frfs=frfs))
    assert path.read_text().count("\n    58\n") == 5
    values[0, 0, 3] = np.nan
    broken = FrfSet(test.frfs.freq_hz, values, _RESPONSES, _REFERENCES, "mobility")
    with pytest.raises(FemtuneError, match="missing values"):
        write_uff_frfs(tmp_path / "b.uff", ModalTest("a", test.units, test.geometry, frfs=broken))


def test_what_the_format_cannot_hold_is_refused(tmp_path: Path) -> None:
    test = _test(np.array([1.0, 1.0 + 1e-12]))
    with pytest.raises(FemtuneError, match="two frequency lines have the same first ten digits"):
        write_uff_frfs(tmp_path / "a.uff", test)
    with pytest.raises(FemtuneError, match="no FRFs"):
        write_uff_frfs(tmp_path / "a.uff", ModalTest("a", test.units))
    with pytest.raises(FemtuneError, match="cannot be written"):
        write_uff_frfs(tmp_path / "nowhere" / "a.uff", _test(_LINES[0]))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("units", "name"), [("mm-t-s", "N"), ("mm-kg-s", "mN"), ("in-slinch-s", "lbf"), ("cm-g-s", "g.cm/s2")]
)
def test_units_of_force_have_their_names(units: str, name: str) -> None:
    assert force_unit(unit_system(units)) == name
