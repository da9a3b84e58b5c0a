"""Studies of matrices: every step runs on them, the modes are checked on import, and no deck is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

import femtune as ft
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.files.nastran import build_structure, read_deck
from femtune.files.uff import write_uff_modes
from femtune.model import Configuration, configure, parametric_model
from femtune.parameters import ParameterSet
from femtune.testdata import ModalTest
from femtune.units import SI

from .matrix_chain import LOWER, TESTED, UPPER, chain, hertz, written


def test_modes_and_info(tmp_path: Path) -> None:
    study = written(tmp_path, "")
    (found,) = ft.modes(study)
    np.testing.assert_allclose(found.freq_hz, hertz(chain(LOWER + UPPER)), rtol=1e-9)
    facts = ft.info(study).record
    assert {"matrices.compared", "matrices.read"} <= {n.code for n in facts.notices}
    assert facts.configurations[0].rigid_body_check.verdict == "not tested"
    assert facts.configurations[0].free_dofs == 5


def test_supports_inside_the_matrices_and_damping_are_told(tmp_path: Path) -> None:
    (tmp_path / "mesh.inp").write_text("*NODE\n" + "".join(f"{10 * (i + 1)}, {i}., 0., 0.\n" for i in range(5)))
    damping = '[[matrix]]\nname = "RUBBER"\nkind = "viscous"\nfile = "lower.mtx"\nfactor = 1e-3\n'
    facts = ft.info(written(tmp_path, damping, model='grid = "mesh.inp"')).record
    check = facts.configurations[0].rigid_body_check
    assert check.verdict == "not tested"
    assert "constrained degrees of freedom were removed" in check.sentence
    assert facts.damping is not None
    assert [(f.kind, f.field) for f in facts.damping.fields] == [("viscous", "viscous RUBBER")]


@pytest.mark.slow
def test_update_and_report(tmp_path: Path) -> None:
    run = ft.run(written(tmp_path))
    update = run.results.update
    assert update is not None
    found = {p.name: p.value for p in update.parameters}
    assert found == pytest.approx({"lower_k": 1.2, "upper_k": 0.9}, rel=1e-6)
    assert "write.no-deck" in {a.code for a in run.results.alerts}
    assert not (run.folder / "updated.bdf").exists()
    assert run.report is not None
    text = run.report.read_text(encoding="utf-8")
    assert "no deck" in text
    assert "Values for the other solver" in text
    assert "as the deck" not in text
    assert run.results.study.configurations == ("baseline",)
    assert run.results.study.imported
    assert [m.stage for m in run.results.mode_shapes] == ["before", "after"]
    assert {f.path for f in run.results.provenance.input_files} >= {"lower.mtx", "mass.mtx", "rows.dof", "chain.uff"}


def refusal(study: Path, step: str = "info") -> FemtuneError:
    with pytest.raises(FemtuneError) as error:
        getattr(ft, step)(study)
    return error.value


def test_other_modes_are_refused_on_import(tmp_path: Path) -> None:
    listed = (hertz(chain(LOWER + UPPER)) / 386.089**0.5).tolist()
    error = refusal(written(tmp_path, "", listed=listed), "modes")
    assert error.code == "matrices.modes-differ"
    assert "386.09" in str(error.values["likely cause 1"])
    assert str(error.where).endswith("study.toml:7 (model.listed_hz)")


def test_without_a_list_a_warning_stays(tmp_path: Path) -> None:
    facts = ft.info(written(tmp_path, "", listed=[])).record
    assert {n.level for n in facts.notices if n.code == "matrices.not-compared"} == {"warning"}


def test_sensors_need_coordinates_or_numbers(tmp_path: Path) -> None:
    error = refusal(written(tmp_path, TESTED.replace("by_id = true", "")), "correlate")
    assert error.code == "matrices.no-coordinates"
    assert "by_id = true" in error.hint
    (tmp_path / "mesh.inp").write_text("*NODE\n" + "".join(f"{10 * (i + 1)}, {i}., 0., 0.\n" for i in range(5)))
    study = written(tmp_path, TESTED.replace("by_id = true", ""), model='grid = "mesh.inp"')
    (found,) = ft.correlate(study)
    assert found.pairs


def test_matrices_of_other_size_and_unknown_fields(tmp_path: Path) -> None:
    study = written(tmp_path, "")
    scipy.io.mmwrite(tmp_path / "mass.mtx", sp.eye_array(4).tocoo())
    error = refusal(study)
    assert error.code == "matrices.size"
    assert "mass has 4 rows, but the list of DOFs has 5" in error.what
    study = written(tmp_path, "")
    study.write_text(study.read_text().replace("MATRIX UPPER", "MATRIX UPER"))
    error = refusal(study)
    assert error.code == "study.unknown-field"
    assert "did you mean 'UPPER'?" in error.hint


def test_negative_and_missing_mass(tmp_path: Path) -> None:
    study = written(tmp_path, "")
    text = study.read_text()
    study.write_text(text.replace('kind = "mass"', 'kind = "mass"\nfactor = -1.0'))
    error = refusal(study)
    assert error.code == "matrices.negative-diagonal"
    assert error.values["DOF"] == "10X"
    study.write_text(text.replace('kind = "mass"', 'kind = "viscous"'))
    assert refusal(study).code == "matrices.no-mass"


def test_rules_between_the_tables(tmp_path: Path) -> None:
    study = written(tmp_path, "")
    text = study.read_text()
    study.write_text(text.replace('units = "m-kg-s"', 'units = "m-kg-s"\ndeck = "lower.mtx"'))
    assert refusal(study).code == "study.matrices"
    study.write_text(text.replace('name = "UPPER"', 'name = "LOWER"', 1))
    assert refusal(study).code == "study.duplicate-name"
    study.write_text('[study]\ntitle = "x"\nunits = "m-kg-s"\n')
    assert refusal(study).code == "study.missing-key"


SPRINGS = """SOL 103
CEND
{case}
BEGIN BULK
SPOINT,1,THRU,3
CELAS2,1,1000.,1
CELAS2,2,500.,1,,2
{more}
CMASS2,11,1.,1
CMASS2,12,2.,2
CMASS2,13,{mass},3
{dmig}
ENDDATA
"""
STIFF = "DMIG,STIFF,0,6,2,0\nDMIG,STIFF,2,0,,2,0,100.\n,3,0,-100.\nDMIG,STIFF,3,0,,3,0,100."
HEAVY = "DMIG,HEAVY,0,6,1,0\nDMIG,HEAVY,3,0,,3,0,3."


def frequencies(folder: Path, text: str) -> np.ndarray:
    (folder / "deck.bdf").write_text(text)
    return np.array(ft.modes(folder / "deck.bdf")[0].freq_hz)


def test_matrices_that_case_control_adds_are_those_of_elements(tmp_path: Path) -> None:
    plain = SPRINGS.format(case="", more="CELAS2,3,250.,2,,3", mass="5.", dmig="")
    case = "K2GG = 2.5*STIFF\nM2GG = HEAVY"
    added = SPRINGS.format(case=case, more="", mass="2.", dmig=f"{STIFF}\n{HEAVY}")
    np.testing.assert_allclose(frequencies(tmp_path, added), frequencies(tmp_path, plain), rtol=1e-12)


def test_wtmass_does_not_scale_m2gg_and_cm2_does(tmp_path: Path) -> None:
    def mass(params: str) -> np.ndarray:
        text = SPRINGS.format(case="K2GG = STIFF\nM2GG = HEAVY", more=params, mass="2.", dmig=f"{STIFF}\n{HEAVY}")
        (tmp_path / "deck.bdf").write_text(text)
        structure = build_structure(read_deck(tmp_path / "deck.bdf")).structure
        model = parametric_model(structure, ParameterSet(()), ())
        return np.asarray(configure(model, Configuration()).at(np.zeros(0)).mass.toarray())

    np.testing.assert_allclose(np.diag(mass("PARAM,WTMASS,.1")), [0.1, 0.2, 3.2])
    np.testing.assert_allclose(np.diag(mass("PARAM,CM2,.5")), [1.0, 2.0, 3.5])


def test_a_dmig_that_names_a_point_that_is_not_there(tmp_path: Path) -> None:
    text = SPRINGS.format(case="K2GG = STIFF", more="", mass="2.", dmig=STIFF.replace("STIFF,3,0,,3", "STIFF,9,0,,9"))
    (tmp_path / "deck.bdf").write_text(text)
    error = refusal(tmp_path / "deck.bdf")
    assert error.code == "model.unknown-node"
    (tmp_path / "deck.bdf").write_text(SPRINGS.format(case="K2GG = OTHER", more="", mass="2.", dmig=STIFF))
    assert refusal(tmp_path / "deck.bdf").code == "matrices.no-such-matrix"


GRIDS = """SOL 103
CEND
K2GG = {factor}*STIFF
BEGIN BULK
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,2.,0.,0.
CELAS2,1,1000.,1,1
CELAS2,2,500.,1,1,2,1
CMASS2,11,1.,1,1
CMASS2,12,2.,2,1
CMASS2,13,5.,3,1
DMIG,STIFF,0,6,2,0
DMIG,STIFF,2,1,,2,1,100.
,3,1,-100.
DMIG,STIFF,3,1,,3,1,100.
ENDDATA
"""


@pytest.mark.slow
def test_the_factor_of_a_matrix_of_a_deck_is_updated_without_a_deck(tmp_path: Path) -> None:
    (tmp_path / "deck.bdf").write_text(GRIDS.format(factor=2.5))
    (tmp_path / "true.bdf").write_text(GRIDS.format(factor=3.0))
    sensors = DofSet.parse(["1X+", "2X+", "3X+"])
    modes = ft.modes(tmp_path / "true.bdf").mode_sets["baseline"].select_dofs(sensors)
    write_uff_modes(tmp_path / "chain.uff", ModalTest("chain", SI, modes=modes))
    (tmp_path / "study.toml").write_text(
        '[study]\ntitle = "x"\nunits = "m-kg-s"\ndeck = "deck.bdf"\n[modes]\ncount = 3\n'
        '[[parameter]]\nname = "k"\nfields = ["MATRIX STIFF"]\nlower = 0.5\nupper = 2.0\n'
        + TESTED
        + "[write]\ndeck = false\n"
    )
    run = ft.run(tmp_path / "study.toml")
    assert run.results.update is not None
    assert run.results.update.parameters[0].value == pytest.approx(1.2, rel=1e-6)
    assert run.results.write_back is None


def test_a_folder_or_device_where_a_matrix_should_be(tmp_path: Path) -> None:
    study = written(tmp_path, "")
    for name in ("/dev/zero", str(tmp_path)):
        study.write_text(study.read_text().replace("upper.mtx", name, 1))
        error = refusal(study)
        assert "the file of a matrix is a folder or a device, not a file" in str(error)
        study.write_text(study.read_text().replace(name, "upper.mtx", 1))
