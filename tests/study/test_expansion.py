"""[correlate] expand: expanded test shapes in results, report and Universal File."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from tests.messages.shown import check_shown

import femtune as ft
from femtune.cli import main
from femtune.errors import FemtuneError
from femtune.files.uff import read_uff
from femtune.units import SI

from .cantilever import EI, Bench, modes_of_deck

FEW = tuple(f"{node}{d}+" for node in (2, 4, 5) for d in ("Y", "Z"))


@pytest.fixture
def few(bench: Bench) -> Bench:
    """A test of the deck's own modes at three of the four free grid points."""
    bench.uff(bench.measure(bench.folder / "beam.bdf", *FEW, count=3))
    return bench


@pytest.mark.slow
@pytest.mark.parametrize("method", ["serep", "dynamic", "mdre"])
def test_modes_of_the_deck_itself_are_expanded_to_its_grid_points(few: Bench, method: str) -> None:
    study = few.study(f'{EI}[correlate]\nexpand = "{method}"\nexpand_noise = 1e-6\n')
    found = ft.correlate(study)
    record = found[0].expansion
    assert record is not None
    assert record.method == method
    assert record.groups == 3
    shapes = found.arrays[record.shapes_key]
    assert shapes.shape == (5, 6, 3)
    np.testing.assert_array_equal(found.arrays[record.nodes_key], [1, 2, 3, 4, 5])
    wanted = modes_of_deck(few.folder / "beam.bdf", 3)[1].reshape(5, 6, -1)[:, :, :3]
    # the file has six digits
    np.testing.assert_allclose(shapes, wanted, atol=3e-5 * np.abs(wanted).max())
    for mode in record.modes:
        assert {e.method for e in mode.errors} == {"serep", "dynamic", "mdre"}
        assert mode.misfit_percent is not None
        assert mode.misfit_percent < 1e-3
        assert all(e.error_percent is not None and e.error_percent < 0.5 for e in mode.errors)
    rows = found.expansion
    assert rows.column("test_label").tolist() == ["1", "2", "3"]
    assert rows.column("dynamic").max() < 0.5


def test_the_file_has_the_shapes_on_the_mesh_of_the_model(few: Bench) -> None:
    uff = few.folder / "expanded.uff"
    found = ft.correlate(few.study(), expand="serep", uff=uff)
    assert found.files == (uff,)
    test = read_uff(uff, units=SI).test
    assert test.modes is not None
    assert {d.node for d in test.modes.dofs} == {2, 3, 4, 5}
    assert test.geometry.nodes.tolist() == [1, 2, 3, 4, 5]
    assert (1, 2) in test.geometry.elements
    wanted = found.expanded["baseline"]
    np.testing.assert_allclose(test.modes.freq_hz, wanted.freq_hz, rtol=1e-5)
    one = test.modes.select_dofs(wanted.dofs.common(test.modes.dofs))
    np.testing.assert_allclose(one.shapes, wanted.select_dofs(one.dofs).shapes, atol=2e-6 * np.abs(wanted.shapes).max())


@pytest.mark.slow
def test_a_run_keeps_shapes_of_both_versions_and_writes_the_last(beam: Bench) -> None:
    study = beam.study(f'{EI}[correlate]\nexpand = "dynamic"\n')
    result = ft.run(study)
    stages = [c.stage for c in result.results.correlations if c.expansion is not None]
    assert stages == ["before", "after as written"]
    before, after = (c.expansion for c in result.results.correlations if c.expansion is not None)
    worst = [max(e.error_percent for m in x.modes for e in m.errors if e.method == "dynamic") for x in (before, after)]
    # the updated model predicts what was left out
    assert worst[1] < 0.3 * worst[0]
    written = read_uff(result.folder / "expanded.uff", units=SI).test
    assert written.modes is not None
    assert len(written.modes) == 4
    page = (result.folder / "report.html").read_text()
    assert "Expanded test shapes" in page
    assert "Expansion by dynamic expansion, before" in page
    again = ft.read_results(result.folder)
    assert again.results.correlations == result.results.correlations


@pytest.mark.slow
def test_serep_takes_the_paired_modes_or_those_that_the_study_wants(beam: Bench) -> None:
    paired = ft.correlate(beam.study(), expand="serep")[0].expansion
    assert paired is not None
    assert paired.serep_modes == (1, 2, 3, 4)
    more = ft.correlate(beam.study(f'{EI}[correlate]\nexpand = "serep"\nexpand_modes = 6\n'))[0].expansion
    assert more is not None
    assert more.serep_modes == (1, 2, 3, 4, 5, 6)
    # eight sensors: six modes remain determined without one test node, of two sensors
    assert all(m.errors[0].error_percent is not None for m in more.modes)


def test_modes_that_the_study_leaves_out_are_not_expanded(beam: Bench) -> None:
    tail = 'leave_out = [{ mode = "2", reason = "local" }]\n[correlate]\nexpand = "serep"\n'
    record = ft.correlate(beam.study(f"{tail}{EI}"))[0].expansion
    assert record is not None
    assert [m.test_label for m in record.modes] == ["1", "3", "4"]


@pytest.mark.slow
def test_the_command_prints_the_errors_and_writes_the_file(few: Bench) -> None:
    study, uff = few.study(), few.folder / "out.uff"
    shown = CliRunner().invoke(main, ["correlate", str(study), "--expand", "mdre", "--uff", str(uff)])
    assert shown.exit_code == 0, shown.output
    assert "minimum dynamic residual" in shown.output
    assert uff.is_file()
    data = json.loads(CliRunner().invoke(main, ["correlate", str(study), "--expand", "serep", "--json"]).stdout)
    assert data[0]["expansion"]["method"] == "serep"


@pytest.mark.parametrize(
    ("key", "code"),
    [
        ('expand = "kriging"', "study.value"),
        ("expand_modes = 0", "study.value"),
        ("expand_noise = 1.0", "study.value"),
        ('expand_noise = "small"', "study.type"),
    ],
)
def test_bad_keys_are_errors_at_their_line(beam: Bench, key: str, code: str) -> None:
    with pytest.raises(FemtuneError) as error:
        ft.correlate(beam.study(f"{EI}[correlate]\n{key}\n"))
    assert error.value.code == code
    assert error.value.where is not None
    assert error.value.where.line is not None


def test_a_file_without_an_expansion_is_refused_before_anything_is_solved(beam: Bench, tmp_path: Path) -> None:
    with pytest.raises(FemtuneError) as error:
        ft.correlate(beam.study(), uff=tmp_path / "expanded.uff")
    assert error.value.code == "correlate.no-expansion"
    check_shown("correlate.no-expansion", str(error.value).replace(f"{tmp_path}/", ""))
    with pytest.raises(FemtuneError) as error:
        ft.correlate(beam.study(), expand="guyan")
    assert error.value.code == "study.value"
    with pytest.raises(FemtuneError) as error:
        ft.correlate(beam.study(), expand="serep", uff=beam.folder / "beam.uff")
    assert error.value.code == "write.overwrites-input"


@pytest.mark.slow
def test_a_reversed_sensor_is_the_one_that_lowers_the_mac(bench: Bench) -> None:
    test = bench.measure(bench.folder / "beam.bdf")
    assert test.modes is not None
    shapes = test.modes.shapes.copy()
    shapes[test.modes.dofs.labels().index("3Z+")] *= -1.0
    bench.uff(replace(test, modes=replace(test.modes, shapes=shapes)))
    study = bench.study(EI)
    found = ft.correlate(study)
    rows = {c.dof: c for c in found[0].contributions}
    best = max(rows.values(), key=lambda c: c.mac_change)
    assert best.dof == "3Z+"
    assert max(rows.values(), key=lambda c: c.ecomac).dof == "3Z+"
    assert found[0].mac_without_key is not None
    without = found.arrays[found[0].mac_without_key]
    assert without.shape == (8, len(found[0].pairs))
    np.testing.assert_allclose(without[list(rows).index("3Z+")], 1.0, rtol=1e-6)
    assert found.contributions.column("dof").tolist() == list(rows)
    shown = CliRunner().invoke(main, ["correlate", str(study)]).output
    assert "MAC without one DOF" in shown


@pytest.mark.slow
def test_a_file_that_cannot_be_written_is_an_alert_and_not_the_end_of_a_run(beam: Bench) -> None:
    study = beam.study(f'{EI}[correlate]\nexpand = "serep"\n')
    assert "expanded.uff" in ft.update(study).files
    (beam.folder / "run" / "expanded.uff").write_text("not a Universal File")
    result = ft.update(study)
    assert "expanded.uff" not in result.files
    assert [a.code for a in result.results.alerts if a.level == "problem"] == ["uff.cannot-write"]
    assert (result.folder / "expanded.uff").read_text() == "not a Universal File"
    assert result.deck is not None
