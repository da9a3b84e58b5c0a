"""The aeroplane testbed's measured functions, which lie beside the checkout."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.files.uff import read_uff
from femtune.identification import (
    Limits,
    PoleTable,
    Rule,
    as_modes,
    choose,
    chosen_poles,
    fit_modes,
    join_tables,
    n4sid_poles,
    normal_equations,
    plscf_poles,
    subspace,
)
from femtune.modal import FrfSet
from femtune.testdata import renumber
from femtune.units import SI

_BAND = Limits(band_hz=(4.0, 66.0))


@pytest.fixture(scope="module")
def frfs(shared_data: Path) -> FrfSet:
    test = renumber(read_uff(shared_data / "garteur" / "frf_1995.unv", units=SI, file_units=SI).test, {12: 1012})
    assert test.frfs is not None
    return test.frfs


@pytest.fixture(scope="module")
def tables(frfs: FrfSet) -> tuple[PoleTable, PoleTable]:
    by_subspace = n4sid_poles(subspace(frfs, 60), range(2, 61, 2))
    return by_subspace, plscf_poles(normal_equations(frfs, 40), range(2, 41))


def _elastic(table: PoleTable) -> PoleTable:
    return chosen_poles(choose(table, _BAND, Rule(collinearity=0.9)), table)


def test_nine_elastic_modes_by_each_method_within_two_thousandths(tables: tuple[PoleTable, PoleTable]) -> None:
    one, other = (_elastic(table) for table in tables)
    assert (len(one), len(other)) == (9, 9)
    np.testing.assert_allclose(one.freq_hz, other.freq_hz, rtol=2e-3)
    np.testing.assert_allclose(one.damping_ratio, other.damping_ratio, rtol=0.05)
    pair = one.freq_hz[2:4]
    assert pair == pytest.approx([33.5, 34.0], abs=0.05)


def test_a_tenth_pole_of_the_file_is_complex(tables: tuple[PoleTable, PoleTable]) -> None:
    """The functions were synthesised by their owners out of ten poles; that at 8.98 Hz is no shape of the aeroplane."""
    found = [c for c in choose(join_tables(tables), _BAND) if c.chosen]
    assert len(found) == 10
    assert found[1].freq_hz == pytest.approx(8.984, abs=0.01)
    assert found[1].collinearity < 0.9 < min(c.collinearity for c in found if c is not found[1])


@pytest.mark.slow
def test_ten_modes_are_all_that_the_functions_hold(frfs: FrfSet, tables: tuple[PoleTable, PoleTable]) -> None:
    table = join_tables(tables)
    fit = fit_modes(frfs, chosen_poles(choose(table, _BAND), table).poles)
    error = np.linalg.norm(fit.synthesised.values - frfs.values, axis=2) / np.linalg.norm(frfs.values, axis=2)
    assert error.max() < 1e-5
    modes = as_modes(fit)
    assert modes.normalisation == "mass"
    # the file's numbers have six digits
    assert modes.freq_sd_hz is not None
    assert modes.freq_sd_hz.max() < 1e-5
