"""What a study may say beside decks and parameters: configurations, tests, sensors, pairs, side conditions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import femtune as ft
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import ModeSet
from femtune.model import Configuration
from femtune.model.configuration import AddedMass
from femtune.steps.run.result import RunResult
from femtune.testdata import ModalTest, WireFrame
from femtune.testdata.convert import convert_units, place
from femtune.units import unit_system

from .cantilever import Bench


def values(run: RunResult) -> dict[str, float]:
    assert run.results.update is not None
    return {p.name: p.value for p in run.results.update.parameters}


def is_true(run: RunResult, rel: float = 1e-4) -> bool:
    return values(run) == pytest.approx({"root": 1.3, "tip": 0.85}, rel=rel)


def before(run: RunResult) -> Any:
    return run.results.correlations[0]


STATES = {
    "light": Configuration("light", elements_off=frozenset({9})),
    "loaded": Configuration("loaded", masses=(AddedMass(3, 1.5),)),
    "propped": Configuration("propped", supports_added=((5, "23"),)),
    "loose": Configuration("loose", supports_removed=((1, "5"),)),
}
KEYS = {
    "light": "elements_off = [9]\nweighed_mass = 7.5",
    "loaded": 'masses = [{ node = 3, mass = 1.5, label = "block" }]',
    "propped": 'supports_added = ["5:23"]',
    "loose": 'supports_removed = ["1:5"]',
}


def blocks(**more: str) -> str:
    """[[configuration]] entries of all states."""
    out = ""
    for name, keys in KEYS.items():
        out += (
            f'[[configuration]]\nname = "{name}"\ntest = "beam.uff"\nrecords = "{name}"\n{keys}\n{more.get(name, "")}\n'
        )
    return out


@pytest.fixture
def states(bench: Bench) -> Bench:
    """One test of each state in one file."""
    true = bench.truth()
    # the tests share a geometry; the supported sensors do not move in one of them and are left out of all
    labels = ("2Y+", "2Z+", "3Y+", "3Z+", "4Y+", "4Z+")
    bench.uff([bench.measure(true, *labels, configuration=c, name=name) for name, c in STATES.items()])
    return bench


@pytest.mark.slow
def test_several_configurations_with_overlays(states: Bench) -> None:
    run = ft.update(states.study(blocks() + states.parameters, test=None))
    assert is_true(run)
    assert [c.configuration for c in run.results.correlations[:4]] == list(STATES)
    assert run.results.model is not None
    masses = {c.configuration: c.mass for c in run.results.model.configurations}
    assert masses == pytest.approx({"light": 7.85, "loaded": 11.35, "propped": 9.85, "loose": 9.85})
    light = run.results.model.configurations[0]
    assert (light.weighed_mass, light.mass_difference_percent) == (7.5, pytest.approx(100 * 0.35 / 7.5))
    (told,) = [a.sentence for a in run.results.alerts if a.code == "model.mass-differs"]
    assert told.startswith("light: ")
    assert "+4.7 %" in told
    written = run.folder / "updated.bdf"
    last = [m for m in run.results.modes if m.stage == "after as written"]
    assert last[2].freq_hz == pytest.approx(
        ft.modes(states.write("one.toml", f'[study]\ntitle="t"\ndeck="{written}"\nunits="m-kg-s"\n[modes]\ncount=6\n'
                                 '[[configuration]]\nname="p"\nsupports_added=["5:23"]'))[0].freq_hz)  # fmt: skip


@pytest.mark.slow
def test_a_configuration_for_validation_is_predicted_and_not_used(states: Bench) -> None:
    run = ft.update(states.study(blocks(propped='use = "validation"') + states.parameters, test=None))
    assert is_true(run)
    assert run.results.selection is not None
    assert not any(label.startswith("propped") for label in run.results.selection.row_labels)
    assert run.results.validation is not None
    found = run.results.validation.predictions
    assert [(p.configuration, p.test_label) for p in found] == [("propped", str(i)) for i in (1, 2, 3, 4)]
    assert all(abs(p.freq_error_percent) < 0.01 for p in found)
    assert max(abs(p.before_freq_error_percent) for p in found) > 1.0
    assert not any("no configurations or modes were held out" in text for text in run.results.validation.not_tested)


@pytest.mark.slow
def test_a_configuration_without_test_is_solved_only(states: Bench) -> None:
    more = '[[configuration]]\nname = "bare"\n'
    run = ft.update(states.study(blocks() + more + states.parameters, test=None))
    assert [m.configuration for m in run.results.modes].count("bare") == 3
    assert "bare" not in {c.configuration for c in run.results.correlations}
    assert run.results.validation is not None
    assert "bare: the configuration has no test with modes" in run.results.validation.not_tested


@pytest.mark.slow
def test_names_of_configurations_may_be_strange(states: Bench) -> None:
    names = {"light": "a/b", "loaded": "../..", "propped": '<b>"ü"</b>', "loose": "x\\u0000y"}
    text = blocks()
    for old, new in names.items():
        text = text.replace(f'name = "{old}"', "name = '" + new + "'" if "u0000" not in new else f'name = "{new}"')
    run = ft.run(states.study(text + states.parameters, test=None))
    assert is_true(run)
    assert run.report is not None
    assert '<b>"ü"</b>' not in run.report.read_text()
    assert all(".." not in key and "\0" not in key for key in run.arrays)
    assert ft.report(run.folder) == run.report


def test_all_kept_for_validation_is_refused(beam: Bench) -> None:
    text = '[[configuration]]\nname = "a"\ntest = "beam.uff"\nuse = "validation"\n'
    study = beam.study(text + beam.parameters, test=None)
    with pytest.raises(FemtuneError) as caught:
        ft.update(study)
    assert caught.value.code == "study.no-test"
    assert caught.value.values == {"a": "it is kept for validation"}
    assert len(ft.correlate(study)) == 1


@pytest.mark.slow
def test_test_in_millimetres(beam: Bench) -> None:
    beam.uff(convert_units(beam.measure(beam.truth()), unit_system("mm-t-s")))
    assert is_true(ft.update(beam.study()))


@pytest.mark.slow
def test_test_with_turned_axes(beam: Bench) -> None:
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    seen = beam.measure(beam.truth())
    # the test's own frame: model = turn @ test + origin, so test = turn.T @ (model - origin)
    moved = place(seen, turn.T, -turn.T @ np.array([0.0, 0.0, 0.5]))
    labels = DofSet.parse([f"{n}{d}+" for n in (2, 3, 4, 5) for d in ("X", "Z")])
    # along the test's X lies the model's Y
    modes = ModeSet(seen.modes.freq_hz, seen.modes.shapes, labels)
    beam.uff(ModalTest("t", seen.units, WireFrame(moved.geometry.nodes, moved.geometry.coordinates), modes=modes))
    keys = "rotation = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]\norigin = [0, 0, 0.5]\n"
    assert is_true(ft.update(beam.study(keys + beam.parameters)))


def shifted(test: ModalTest, by: float) -> ModalTest:
    frame = test.geometry
    numbers = 100 + frame.nodes
    labels = DofSet.parse([f"{100 + d.node}{d.direction}+" for d in test.modes.dofs])
    return replace(test, geometry=WireFrame(numbers, frame.coordinates + by), modes=replace(test.modes, dofs=labels))


@pytest.mark.slow
def test_sensors_find_the_nearest_grid_point(beam: Bench) -> None:
    beam.uff(shifted(beam.measure(beam.truth()), 0.01))
    run = ft.update(beam.study("[sensors]\ntolerance = 0.05\n" + beam.parameters))
    assert is_true(run)
    sensors = run.results.sensors[0]
    assert sensors.tolerance == 0.05
    assert [(m.test_node, m.model_node) for m in sensors.matched[::2]] == [(102, 2), (103, 3), (104, 4), (105, 5)]
    assert sensors.matched[0].distance == pytest.approx(0.01 * np.sqrt(3))


@pytest.mark.slow
def test_default_tolerance_is_reported(beam: Bench) -> None:
    beam.uff(shifted(beam.measure(beam.truth()), 0.01))
    with pytest.raises(FemtuneError) as caught:
        ft.update(beam.study())
    assert caught.value.code == "sensor.unmatched"
    beam.uff(shifted(beam.measure(beam.truth()), 1e-5))
    assert ft.update(beam.study()).results.sensors[0].tolerance == pytest.approx(1e-3)


@pytest.mark.slow
def test_sensors_by_hand(beam: Bench) -> None:
    beam.uff(shifted(beam.measure(beam.truth()), 0.5))
    hand = '[sensors]\nnodes = { "102" = 2, "103" = 3, "104" = 4, "105" = 5 }\n'
    run = ft.update(beam.study(hand + beam.parameters))
    assert is_true(run)
    assert "sensor.far-from-node" in {a.code for a in run.results.alerts}


@pytest.mark.slow
def test_generalised_sensor_is_a_combination(beam: Bench) -> None:
    seen = beam.measure(beam.truth())
    shapes = seen.modes.shapes.copy()
    shapes[0] = 0.5 * (shapes[2] + shapes[4])  # what 2Y "measures" is the mean of 3Y and 4Y
    beam.uff(replace(seen, modes=replace(seen.modes, shapes=shapes)))
    halves = ", ".join(f'{{ node = {n}, component = "Y", factor = 0.5 }}' for n in (3, 4))
    terms = f'[[sensor]]\nname = "2Y+"\nterms = [{halves}]\n'
    run = ft.update(beam.study(terms + beam.parameters + "[residuals]\nshape_sd = 0.05\n"))
    assert is_true(run)
    assert run.results.sensors[0].matched[0].how == "combination"
    assert min(p.mac for p in run.results.correlations[-1].pairs) == pytest.approx(1.0, abs=1e-8)
    plain = ft.correlate(beam.study())
    assert min(p.mac for p in plain[0].pairs) < 0.999


@pytest.mark.slow
def test_modes_left_out_by_label_and_by_frequency(beam: Bench) -> None:
    freq = beam.modes(beam.folder / "truth/true.bdf")
    left = f'leave_out = [{{ mode = "c", reason = "noisy" }}, {{ hz = {freq[1]:.6g}, reason = "<i>shaker</i>" }}]\n'
    run = ft.update(beam.study('mode_labels = ["a", "b", "c", "d"]\n' + left + beam.parameters))
    assert [(m.test_label, m.reason) for m in before(run).left_out] == [("b", "<i>shaker</i>"), ("c", "noisy")]
    assert [p.test_label for p in before(run).pairs] == ["a", "d"]
    assert run.results.validation is not None
    assert [p.test_label for p in run.results.validation.predictions] == ["b", "c"]


def test_pairs_fixed_by_hand(beam: Bench) -> None:
    free = ft.correlate(beam.study())[0]
    held = ft.correlate(beam.study('pairs = [{ test = "1", model = 2 }]\n'))[0]
    assert (free.pairs[0].model_number, free.pairs[0].fixed_by_hand) == (1, False)
    assert (held.pairs[0].model_number, held.pairs[0].fixed_by_hand) == (2, True)
    assert held.pairs[0].model_freq_hz == pytest.approx(beam.modes(beam.folder / "beam.bdf")[1])


@pytest.mark.slow
def test_complex_shapes_are_turned_to_real_ones(beam: Bench) -> None:
    seen = beam.measure(beam.truth())
    turned = seen.modes.shapes * np.exp(1j * np.linspace(0.3, 2.0, len(seen.modes)))
    modes = replace(seen.modes, shapes=turned, damping_ratio=np.full(len(seen.modes), 0.02), normalisation="unknown")
    beam.uff(replace(seen, modes=modes))
    run = ft.update(beam.study())
    assert values(run) == pytest.approx({"root": 1.3, "tip": 0.85}, rel=1e-3)
    assert min(p.mac for p in before(run).pairs) > 0.99


@pytest.mark.slow
def test_configurations_whose_tests_have_other_sensors(bench: Bench) -> None:
    true = bench.truth()
    bench.uff(bench.measure(true, "3Y+", "5Y+", "5Z+"), "few.uff")
    bench.uff(bench.measure(true, "2Z+", "4Z+", "5Z+", "4Y+", count=3), "other.uff")
    text = '[[configuration]]\nname = "a"\ntest = "few.uff"\n[[configuration]]\nname = "b"\ntest = "other.uff"\n'
    run = ft.update(bench.study(text + bench.parameters, test=None))
    assert is_true(run)
    assert [len(s.matched) for s in run.results.sensors] == [3, 4]


@pytest.mark.slow
def test_minimum_change_and_prior(beam: Bench) -> None:
    free = ft.update(beam.study())
    near = ft.update(beam.study(beam.parameters + '[update]\nregularisation = "minimum-change"\nweight = 100.0\n'))
    assert abs(values(near)["root"] - 1.0) < 0.7 * abs(values(free)["root"] - 1.0)
    assert near.results.update is not None
    assert near.results.update.regularisation_weight == 100.0
    prior = beam.parameters.replace("upper = 2.0", "upper = 2.0\nmean = 1.1\nsd = 0.0001")
    held = ft.update(beam.study(prior + '[update]\nregularisation = "prior"\n'))
    assert values(held) == pytest.approx({"root": 1.1, "tip": 1.1}, abs=0.01)


def test_scatter_of_the_test_needs_scatter(beam: Bench) -> None:
    study = beam.study(beam.parameters + '[residuals]\nfrequency_sd = "test"\n')
    with pytest.raises(FemtuneError) as caught:
        ft.update(study)
    assert caught.value.code == "residual.no-scatter"
    assert caught.value.where is not None
    assert caught.value.where.file == str(study)


@pytest.mark.slow
def test_a_parameter_at_its_bound_is_an_alert(beam: Bench) -> None:
    run = ft.update(beam.study(beam.parameters.replace("upper = 2.0", "upper = 1.1", 1)))
    assert run.results.update is not None
    root = run.results.update.parameters[0]
    assert (root.value, root.at_bound, root.sd, root.sd_reason) == (1.1, "upper", None, "at bound, σ not given")
    assert any(a.code == "update.at-bound" and "root" in a.sentence for a in run.results.alerts)


@pytest.mark.slow
def test_undetermined_parameters_are_an_alert(beam: Bench) -> None:
    tail = beam.parameters.replace("PBAR 2 I1", "PBAR 2 J")
    run = ft.update(beam.study(tail))
    assert "update.undetermined" in {a.code for a in run.results.alerts}
    update = run.results.update
    assert update is not None
    assert update.parameters[1].value == pytest.approx(1.0, abs=1e-6)
    assert update.smallest_change is not None
    assert update.smallest_change.increase <= update.smallest_change.allowed
    assert update.certificate is not None
    assert update.iteration == update.history[-1].iteration
    assert any(i.to_smallest_change for i in update.history) or update.smallest_change.size == pytest.approx(
        update.smallest_change.optimum_size, rel=1e-6
    )


@pytest.mark.slow
def test_the_minimum_itself_can_be_asked_for(beam: Bench) -> None:
    tail = beam.parameters.replace("PBAR 2 I1", "PBAR 2 J") + "\n[update]\nsmallest_change = 0\n"
    run = ft.update(beam.study(tail))
    assert run.results.update is not None
    assert run.results.update.ok
    assert run.results.update.smallest_change is None


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [*(("update", "smallest_change", value) for value in ("-0.1", "1e4", '"no"')),
     *(("residuals", "common_frequency_sd", value) for value in ("-0.1", "1.5", '"test"'))],
)  # fmt: skip
def test_a_value_that_cannot_be_is_an_error_of_its_key(beam: Bench, table: str, key: str, value: str) -> None:
    with pytest.raises(FemtuneError, match=key):
        ft.update(beam.study(beam.parameters + f"\n[{table}]\n{key} = {value}\n"))


SQUARE = """SOL 103
CEND
SPC = 1
BEGIN BULK
GRID    1               0.0     0.0     0.0
GRID    2               0.0     0.0     1.0
GRID    3               0.0     0.0     2.0
MAT1    1       2.1+11          0.3     7850.
PBAR    1       1       1.0-3   2.0-7   2.0-7   4.0-7
PBAR    2       1       1.0-3   2.0-7   2.0-7   4.0-7
CBAR    1       1       1       2       1.0     0.0     0.0
CBAR    2       2       2       3       1.0     0.0     0.0
CONM2   9       3               2.0
SPC1    1       123456  1
ENDDATA
"""


@pytest.fixture
def mast(bench: Bench) -> Bench:
    """A mast of square section: every bending mode is double."""
    bench.write("beam.bdf", SQUARE)
    changed = (("2       1       1.0-3   2.0-7   2.0-7", "2       1       1.0-3   1.6-7   1.6-7"),)
    bench.truth(changed, SQUARE)
    return bench


BOTH = """
[[parameter]]
name = "lower_part"
fields = ["PBAR 1 I1", "PBAR 1 I2"]
lower = 0.5
upper = 2.0
[[parameter]]
name = "upper_part"
fields = ["PBAR 2 I1", "PBAR 2 I2"]
lower = 0.5
upper = 2.0
"""


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_double_modes_in_any_orientation(mast: Bench, angle: float) -> None:
    seen = mast.measure(mast.folder / "truth/true.bdf", "2X+", "2Y+", "3X+", "3Y+", count=4)
    shapes = seen.modes.shapes.copy()
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    shapes[:, :2] = shapes[:, :2] @ turn
    mast.uff(replace(seen, modes=replace(seen.modes, shapes=shapes)))
    run = ft.update(mast.study(BOTH + "[residuals]\nshape_sd = 0.1\n"))
    assert run.results.update is not None
    assert run.results.update.ok
    assert values(run) == pytest.approx({"lower_part": 1.0, "upper_part": 0.8}, rel=1e-4)
    last = run.results.correlations[-1]
    assert last.clusters
    assert all(p.mac == pytest.approx(1.0, abs=1e-5) for p in last.pairs)


@pytest.mark.slow
def test_double_modes_that_a_parameter_separates(mast: Bench) -> None:
    true = mast.truth((("2.0-7   2.0-7   4.0-7\nPBAR    2", "2.5-7   2.0-7   4.0-7\nPBAR    2"),), SQUARE)
    mast.uff(mast.measure(true, "2X+", "2Y+", "3X+", "3Y+", count=4))
    tail = BOTH.replace('"PBAR 1 I1", "PBAR 1 I2"', '"PBAR 1 I1"').replace('"PBAR 2 I1", "PBAR 2 I2"', '"PBAR 1 I2"')
    run = ft.update(mast.study(tail))
    assert run.results.update is not None
    assert run.results.update.ok
    assert values(run) == pytest.approx({"lower_part": 1.25, "upper_part": 1.0}, rel=1e-3)


FREE = (
    ("SPC = 1\n", ""),
    ("MAT1 ", "GRID    6               0.0     0.3     0.2\nMAT1 "),
    ("CONM2 ", "CBAR    5       2       1       6       0.0     0.0     1.0\nCONM2 "),
)


@pytest.mark.slow
def test_free_structure_with_six_rigid_body_modes(bench: Bench) -> None:
    text = bench.text
    for old, new in FREE:
        text = text.replace(old, new)
    bench.write("beam.bdf", text)
    seen = bench.measure(bench.truth(text=text), *(f"{n}{d}+" for n in range(1, 7) for d in "YZ"), count=12)
    elastic = seen.modes.freq_hz > 1.0
    assert (~elastic).sum() == 6
    modes = ModeSet(seen.modes.freq_hz[elastic], seen.modes.shapes[:, elastic], seen.modes.dofs)
    bench.uff(replace(seen, modes=modes))
    study = bench.study()
    assert ft.modes(study)[0].rigid_body_modes == 6  # all modes that were asked for
    study.write_text(study.read_text().replace("count = 6", "count = 14"))
    run = ft.update(study)
    assert is_true(run, 1e-3)
    assert run.results.modes[0].rigid_body_modes == 6
    assert max(run.results.modes[0].freq_hz[:6]) < 0.01
    assert run.results.model is not None
    assert run.results.model.configurations[0].rigid_body_check.verdict == "pass"


@pytest.mark.slow
@pytest.mark.parametrize("page", [False, True])
def test_modes_of_a_study_with_a_test_heed_a_count_and_a_frequency_of_their_own(beam: Bench, page: bool) -> None:
    study = beam.study()

    def found(**asked: float) -> tuple[float, ...]:
        if page:
            return ft.modes(study, report=beam.folder / "modes.html", **asked)[0].freq_hz  # type: ignore[arg-type]
        return ft.modes(study, **asked)[0].freq_hz  # type: ignore[arg-type]

    usual = found()
    three, nine = found(count=3), found(count=9)
    assert (len(usual), len(three), len(nine)) == (6, 3, 9)
    assert len(found(max_hz=0.5 * (usual[1] + usual[2]))) == 2


@pytest.mark.slow
def test_an_error_that_all_frequencies_share_widens_the_intervals(beam: Bench) -> None:
    text = beam.parameters + "[residuals]\nfrequency_sd = 0.002\n"
    plain, wide = (ft.update(beam.study(text + line)).results.update for line in ("", "common_frequency_sd = 0.03\n"))
    assert plain is not None
    assert wide is not None
    for a, b in zip(plain.parameters[:2], wide.parameters[:2]):
        assert b.value == pytest.approx(a.value, rel=1e-3)
    # the modes in the other plane, whose stiffness is known, tell the common error in part
    assert all(b.sd > a.sd for a, b in zip(plain.parameters, wide.parameters) if a.sd and b.sd)
