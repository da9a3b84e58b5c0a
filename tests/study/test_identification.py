"""The step identify: from files to a folder, as a user calls it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.signal import lfilter
from tests.messages.shown import check_shown
from tests.reporting.packed import unpacked
from tests.reporting.page_scripts import without_own_scripts

from femtune import identify
from femtune.cli import main
from femtune.document.document import Paragraph
from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.files.deviations import with_deviations
from femtune.files.uff import read_uff, write_uff_frfs
from femtune.identification import operational
from femtune.modal import StateSpace
from femtune.modal.shape_criteria import mac
from femtune.steps.identify.page import build_identification_page
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI
from structures.laboratory import (
    Clock,
    MeasuringChain,
    accelerance,
    multisine,
    plant_of_matrices,
    simulated_test,
    white_noise,
)

DOFS = DofSet(Dof(i, "X") for i in (1, 2, 3))
STIFFNESS = 900.0 * (2.0 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1))
PLANT = plant_of_matrices(np.eye(3), STIFFNESS, 0.01, np.eye(3), DOFS, np.eye(3), DOFS)
CHANNELS = "".join(f'[[channel]]\ncolumn = {i}\ndof = "{i}X+"\n' for i in (1, 2, 3))


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    clock = Clock(600.0, 50.0, 5.0)
    noise = white_noise(np.random.default_rng(0), 3, clock.fine_samples)
    made = simulated_test(PLANT, noise, clock, MeasuringChain(40.0), 0)
    path = tmp_path_factory.mktemp("record") / "ambient.csv"
    np.savetxt(path, made.values.T, delimiter=",", fmt="%.6e")
    return path


def described(record, folder, text):
    path = folder / "identify.toml"
    path.write_text(f'[identify]\nrecord = "{record}"\n{text}\n{CHANNELS}', encoding="utf-8")
    return path


@pytest.mark.slow
def test_a_record_becomes_modes_that_a_study_can_read(record, tmp_path):
    made = identify(described(record, tmp_path, "sampling_hz = 50.0\nband_hz = [1.0, 12.0]\nlargest_order = 20"))
    assert made.folder == tmp_path / "identified"
    modes = read_uff(made.folder / "modes.uff", units=SI).test.modes
    assert modes.freq_hz == pytest.approx(PLANT.truth.freq_hz, rel=5e-3)
    assert list(modes.dofs) == list(DOFS)
    known = with_deviations(modes, made.folder / "deviations.json")
    assert known.freq_sd_hz is not None
    assert (known.freq_sd_hz > 0).all()
    data = json.loads((made.folder / "identified.json").read_text(encoding="utf-8"))
    assert [m["freq_sd_hz"] > 0 for m in data["modes"]] == [True] * 3
    assert set(data["modes"][0]["by_method"]) == {"SSI-cov", "ERA", "FDD"}
    page = (made.folder / "report.html").read_text(encoding="utf-8")
    assert "Stabilisation diagram" in page
    assert "<script" not in without_own_scripts(page)


@pytest.mark.slow
def test_the_order_that_the_record_supports_is_stated(record, tmp_path):
    made = identify(described(record, tmp_path, "sampling_hz = 50.0\nband_hz = [1.0, 12.0]"))
    (said,) = [n for n in made.found.notices if n.code == "identify.order"]
    check_shown("identify.order", said)
    check_shown("identify.likelihood", next(n for n in made.found.notices if n.code == "identify.likelihood"))
    small = identify(described(record, tmp_path, "sampling_hz = 50.0\nband_hz = [1.0, 12.0]\nlargest_order = 4"))
    check_shown("identify.order, larger", next(n for n in small.found.notices if n.code == "identify.order"))


@pytest.mark.slow
def test_fragments_give_means_and_their_scatter(record, tmp_path):
    text = 'sampling_hz = 50.0\nband_hz = [1.0, 12.0]\nlargest_order = 16\nfragments = 3\nmethods = ["ERA", "FDD"]'
    made = identify(described(record, tmp_path, text))
    assert [m.freq_hz for m in made.record.modes] == pytest.approx(PLANT.truth.freq_hz, rel=1e-2)
    assert all(m.estimates >= 3 and m.freq_sd_hz > 0 for m in made.record.modes)


@pytest.mark.slow
def test_choices_by_hand_are_kept(record, tmp_path):
    lowest = float(PLANT.truth.freq_hz[0])
    asked = {"sampling_hz": 50.0, "band_hz": (1.0, 12.0), "drop_hz": (lowest,), "methods": ("SSI-cov",)}
    made = identify(record, output=tmp_path / "out", **asked)
    assert [m.freq_hz for m in made.record.modes] == pytest.approx(PLANT.truth.freq_hz[1:], rel=5e-3)
    with_suspension = {**asked, "drop_hz": (), "suspension_hz": 1.1 * lowest}
    elastic = identify(record, output=tmp_path / "elastic", **with_suspension)
    assert [m.freq_hz for m in elastic.record.modes] == [m.freq_hz for m in made.record.modes]
    # no channel was named, so no study could read the shapes
    assert "modes.uff" not in made.files


@pytest.mark.slow
def test_a_choice_by_hand_need_not_be_met_by_every_method_and_fragment(record, tmp_path, monkeypatch):
    # in every other piece of work the mode that is dropped was not found at all
    lowest, calls = float(PLANT.truth.freq_hz[0]), []
    whole = operational.by_covariances

    def half(piece, asked):
        calls.append(piece)
        above = replace(asked, band_hz=(1.3 * lowest, 12.0))
        return whole(piece, asked if len(calls) % 2 else above)

    monkeypatch.setattr(operational, "by_covariances", half)
    asked = {"sampling_hz": 50.0, "band_hz": (1.0, 12.0), "drop_hz": (lowest,), "fragments": 2, "methods": ("SSI-cov",)}
    made = identify(record, output=tmp_path / "out", **{**asked, "largest_order": 20})
    assert len(calls) == 2
    assert [m.freq_hz for m in made.record.modes] == pytest.approx(PLANT.truth.freq_hz[1:], rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["SSI-cov", "FDD"])
def test_a_choice_that_the_first_method_cannot_make_is_refused(record, tmp_path, method):
    asked = {"sampling_hz": 50.0, "band_hz": (1.0, 12.0), "take_hz": (2.0,), "methods": (method,), "largest_order": 20}
    with pytest.raises(FemtuneError, match="near 2 Hz") as caught:
        identify(record, output=tmp_path / "out", **asked)
    assert "take_hz" in str(caught.value.where)


@pytest.mark.slow
def test_functions_become_modes_and_a_model(tmp_path):
    frfs = accelerance(PLANT, np.linspace(0.5, 12.0, 800))
    frame = WireFrame(np.array([1, 2, 3, 4]), np.eye(4)[:, :3], lines=((1, 2, 3, 4),))
    write_uff_frfs(tmp_path / "frf.unv", ModalTest("t", SI, frame, frfs=frfs))
    made = identify(tmp_path / "frf.unv", largest_order=12)
    view = build_identification_page(made).view
    assert view is not None
    (scene,), (functions,) = view.scenes, view.functions
    stage = scene.stages[0]
    assert unpacked(scene.points) == pytest.approx(frame.coordinates, abs=1e-4)
    assert unpacked(scene.lines).tolist() == [[0, 1], [1, 2], [2, 3]]
    moved, shapes = unpacked(stage.motion), made.found.modes.shapes
    assert np.diag(mac(moved[:3, 0], shapes)) == pytest.approx(1.0, abs=1e-4)
    assert not moved[3].any()
    assert [c.look for c in functions.curves] == ["test", "identified"]
    assert len(functions.titles) == frfs.values[..., 0].size
    assert [m.freq_hz for m in made.record.modes] == pytest.approx(PLANT.truth.freq_hz, rel=1e-4)
    assert [m.damping_ratio for m in made.record.modes] == pytest.approx([0.01] * 3, rel=1e-2)
    with np.load(made.folder / "system.npz") as stored:
        system = StateSpace(*(stored[n] for n in "ABCD"), DOFS, DOFS, "accelerance")
    assert system.frf(frfs.freq_hz).values == pytest.approx(frfs.values, abs=1e-3 * np.abs(frfs.values).max())
    assert made.record.largest_misfit_percent < 0.1


def forced(tmp_path, force, clock, text):
    inputs = np.vstack([force, np.zeros((2, len(force)))])
    made = simulated_test(PLANT, inputs, clock, MeasuringChain(50.0), 0, measured_inputs=(0,))
    np.save(tmp_path / "shaker.npy", made.values)
    path = tmp_path / "shaker.toml"
    column = '[[channel]]\ncolumn = 4\ndof = "1X+"\nquantity = "force"\nrole = "input"\n'
    asked = (
        f'[identify]\nrecord = "shaker.npy"\nsampling_hz = 50.0\nband_hz = [1.0, 12.0]\nlargest_order = 16\n{text}\n'
    )
    path.write_text(asked + CHANNELS + column, encoding="utf-8")
    return path


@pytest.mark.slow
def test_modes_that_the_format_cannot_hold_are_told(record, tmp_path):
    path = described(record, tmp_path, 'sampling_hz = 50.0\nband_hz = [1.0, 12.0]\nmethods = ["FDD"]\n')
    path.write_text(path.read_text().replace('"2X+"', '"2S+"'), encoding="utf-8")
    found = identify(path, output=tmp_path / "out")
    assert "modes.uff" not in found.files
    (told,) = [n for n in found.found.notices if n.level == "warning"]
    check_shown("identify.no-modes-file", told)


@pytest.mark.slow
def test_a_record_with_a_force_becomes_functions_first(tmp_path):
    clock = Clock(600.0, 50.0, 5.0)
    force = white_noise(np.random.default_rng(1), 1, clock.fine_samples)[0]
    made = identify(forced(tmp_path, force, clock, ""))
    assert [m.freq_hz for m in made.record.modes] == pytest.approx(PLANT.truth.freq_hz, rel=2e-3)
    assert [m.damping_ratio for m in made.record.modes] == pytest.approx([0.01] * 3, rel=0.3)
    assert made.record.normalisation == "mass"
    shapes = made.found.modes.shapes
    assert np.abs(shapes) == pytest.approx(np.abs(PLANT.truth.shapes), abs=0.05)
    # it was fitted as a whole: the page says what its coherence is, and that the linearity is not known
    said = " ".join(
        b.text for s in build_identification_page(made).sections for b in s.blocks if isinstance(b, Paragraph)
    )
    assert "since a record that is fitted as a whole has no averages" in said
    assert "Whether the structure is linear was not tested" in said
    averaged = identify(forced(tmp_path, force, clock, "resolution_hz = 0.1"))
    said = " ".join(
        b.text for s in build_identification_page(averaged).sections for b in s.blocks if isinstance(b, Paragraph)
    )
    assert "The coherence is" in said
    assert "fitted as a whole" not in said


@pytest.mark.slow
def test_periods_are_taken_without_a_window(tmp_path):
    clock = Clock(120.0, 50.0, 20.0)
    lines = np.arange(10, 250)
    force = multisine(np.random.default_rng(1), lines, round(20.0 / clock.fine_step_s), 7)
    made = identify(forced(tmp_path, force, clock, "period_s = 20.0"))
    assert [m.freq_hz for m in made.record.modes] == pytest.approx(PLANT.truth.freq_hz, rel=1e-3)
    assert [m.damping_ratio for m in made.record.modes] == pytest.approx([0.01] * 3, rel=0.05)


def test_a_resolution_that_the_record_has_not_is_refused(tmp_path):
    clock = Clock(60.0, 50.0, 0.0)
    force = white_noise(np.random.default_rng(1), 1, clock.fine_samples)[0]
    with pytest.raises(FemtuneError, match="longer than the record"):
        identify(forced(tmp_path, force, clock, "resolution_hz = 0.001"))


def test_a_period_between_samples_is_refused(tmp_path):
    clock = Clock(60.0, 50.0, 0.0)
    force = white_noise(np.random.default_rng(1), 1, clock.fine_samples)[0]
    with pytest.raises(FemtuneError, match="whole number") as caught:
        identify(forced(tmp_path, force, clock, "period_s = 13.33"))
    assert caught.value.where.line


@pytest.mark.slow
def test_a_dead_channel_is_named(record, tmp_path):
    values = np.loadtxt(record, delimiter=",")
    values[:, 1] = 0.0
    np.savetxt(tmp_path / "dead.csv", values, delimiter=",", fmt="%.6e")
    asked = {"sampling_hz": 50.0, "band_hz": (1.0, 12.0), "methods": ("SSI-cov",), "largest_order": 16}
    made = identify(tmp_path / "dead.csv", **asked)
    (dead,) = [a for a in made.record.alerts if a.level != "info"]
    assert dead.code == "record.dead"
    assert "2S+" in dead.sentence


@pytest.mark.slow
def test_what_was_found_before_an_error_is_shown_with_it(record, tmp_path):
    values = np.loadtxt(record, delimiter=",")
    values[700, 1] = 1e30
    np.savetxt(tmp_path / "spike.csv", values, delimiter=",", fmt="%.6e")
    asked = {"sampling_hz": 50.0, "band_hz": (1.0, 12.0), "methods": ("FDD",), "take_hz": (3.0,)}
    with pytest.raises(FemtuneError) as caught:
        identify(tmp_path / "spike.csv", output=tmp_path / "out", **asked)
    assert [n.code for n in caught.value.notices if n.level != "info"] == ["record.spikes"]
    assert "2S+ (1, the first at 14 s)" in str(caught.value)


@pytest.mark.slow
def test_a_channel_in_another_unit_costs_no_mode(record, tmp_path):
    """The values of the channel are in mm/s²: same modes and deviations, entries 1000 times larger."""
    values = np.loadtxt(record, delimiter=",")
    values[:, 1] *= 1000.0
    np.savetxt(tmp_path / "unit.csv", values, delimiter=",", fmt="%.6e")
    asked = {"sampling_hz": 50.0, "band_hz": (1.0, 12.0), "methods": ("SSI-cov",), "largest_order": 16}
    sound, made = identify(record, output=tmp_path / "a", **asked), identify(tmp_path / "unit.csv", **asked)
    assert [a.code for a in made.record.alerts if a.level != "info"] == ["record.other-unit"]
    (said,) = [n for n in made.found.notices if n.code == "record.other-unit"]
    check_shown("record.other-unit", said)
    assert made.modes.freq_hz == pytest.approx(sound.modes.freq_hz, rel=1e-3)
    assert made.modes.freq_sd_hz == pytest.approx(sound.modes.freq_sd_hz, rel=0.1)
    back = made.modes.shapes / np.array([[1.0], [1000.0], [1.0]])
    assert np.diag(mac(back, sound.modes.shapes)) == pytest.approx(1.0, abs=1e-4)
    assert np.abs(made.modes.shapes[1] / made.modes.shapes[0]) == pytest.approx(
        1000.0 * np.abs(sound.modes.shapes[1] / sound.modes.shapes[0]), rel=0.02
    )
    assert made.modes.normalisation == "unknown"


@pytest.mark.slow
def test_the_command_says_the_same(record, tmp_path):
    said = [
        "identify",
        str(record),
        "--rate",
        "50",
        "--band",
        "1",
        "12",
        "--order",
        "16",
        "--output",
        str(tmp_path / "o"),
    ]
    shown = CliRunner().invoke(main, said)
    assert shown.exit_code == 0, shown.output
    assert "report: " in shown.output
    as_json = CliRunner().invoke(main, [*said, "--json", "--quiet"])
    assert len(json.loads(as_json.stdout)["modes"]) == 3


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('frfs = "a.unv"', "exactly one of record"),
        ("band = [1.0, 2.0]", "band_hz"),
        ("band_hz = [9.0, 2.0]", "the frequency band is empty"),
        ('methods = ["SSI"]', "should be one of"),
        ("largest_order = 3", "greater than or equal to 4"),
    ],
)
def test_a_file_that_cannot_be_meant_is_refused(record, tmp_path, text, says):
    with pytest.raises(FemtuneError) as caught:
        identify(described(record, tmp_path, text))
    assert says in str(caught.value)
    assert caught.value.where.line or caught.value.errors[0].where.line


def test_what_is_lacking_is_asked_for(record, tmp_path):
    with pytest.raises(FemtuneError, match="sampling rate"):
        identify(described(record, tmp_path, "band_hz = [1.0, 12.0]"))
    with pytest.raises(FemtuneError, match="needs a frequency band"):
        identify(described(record, tmp_path, "sampling_hz = 50.0"))
    with pytest.raises(FemtuneError, match="the file does not exist"):
        identify(tmp_path / "none.csv")
    with pytest.raises(FemtuneError, match="folder of the results is the folder of the measurement"):
        identify(record, output=record.parent, sampling_hz=50.0, band_hz=(1.0, 12.0))


def test_output_only_methods_are_refused_for_functions(tmp_path):
    (tmp_path / "a.toml").write_text('[identify]\nfrfs = "a.unv"\nmethods = ["FDD"]\n', encoding="utf-8")
    with pytest.raises(FemtuneError, match="FDD needs time records"):
        identify(tmp_path / "a.toml")


@pytest.mark.slow
def test_a_record_of_velocities_and_accelerations_gives_the_shapes_of_accelerations(record, tmp_path):
    values = np.loadtxt(record, delimiter=",").T
    lines = np.fft.rfftfreq(values.shape[1], 1.0 / 50.0)
    spectrum = np.fft.rfft(values[1])
    keep = lines > 0.3
    spectrum[keep] /= 2j * np.pi * lines[keep]
    spectrum[~keep] = 0.0
    np.save(tmp_path / "mixed.npy", np.vstack([values[0], np.fft.irfft(spectrum, values.shape[1]), values[2]]))
    text = "sampling_hz = 50.0\nband_hz = [1.0, 12.0]\nlargest_order = 16\n"
    path = described("mixed.npy", tmp_path, f"{text}methods = ['FDD', 'SSI-cov']")
    said = path.read_text(encoding="utf-8")
    # a velocity in m/s is small beside accelerations: its phase shows in no collinearity
    (notice,) = (n for n in identify(path).found.notices if n.code == "identify.quadrature")
    check_shown("identify.quadrature", notice)
    path.write_text(said.replace('dof = "2X+"', 'dof = "2X+"\nquantity = "velocity"'), encoding="utf-8")
    made = identify(path)
    assert min(m.phase_collinearity for m in made.record.modes) > 0.99
    assert "identify.quadrature" not in {n.code for n in made.found.notices}
    assert np.diag(mac(made.modes.shapes, PLANT.truth.shapes)).min() > 0.999
    path.write_text(said.replace('dof = "2X+"', 'dof = "2X+"\nquantity = "strain"'), encoding="utf-8")
    with pytest.raises(FemtuneError, match="strain"):
        identify(path)


@pytest.mark.slow
def test_agreement_is_of_the_modes_that_several_methods_found(record, tmp_path, monkeypatch):
    lowest, whole = float(PLANT.truth.freq_hz[0]), operational.by_decomposition
    monkeypatch.setattr(
        operational, "by_decomposition", lambda piece, asked: whole(piece, replace(asked, band_hz=(1.3 * lowest, 12.0)))
    )
    asked = {"sampling_hz": 50.0, "band_hz": (1.0, 12.0), "largest_order": 16}
    made = identify(record, output=tmp_path / "two", methods=("SSI-cov", "FDD"), **asked)
    sentence = build_identification_page(made).verdict
    assert "several methods found 2 modes, with frequencies that differ by at most" in sentence
    assert sentence.endswith("only one method found 1 mode.")
    assert [bool(m.remark) for m in made.record.modes] == [True, False, False]
    assert made.record.modes[0].remark == "only the method SSI-cov found the mode"
    (notice,) = (n for n in made.found.notices if n.code == "identify.one-method")
    check_shown("identify.one-method", notice)
    assert "identify.further-modes" not in {n.code for n in made.found.notices}
    turned = identify(record, output=tmp_path / "turned", methods=("FDD", "SSI-cov"), **asked)
    assert "several methods found all modes" in build_identification_page(turned).verdict
    (notice,) = (n for n in turned.found.notices if n.code == "identify.further-modes")
    check_shown("identify.further-modes", notice)
    without = {"methods": ("SSI-cov", "ERA", "FDD"), "drop_hz": (float(PLANT.truth.freq_hz[1]),)}
    dropped = identify(record, output=tmp_path / "dropped", **without, **asked)
    assert len(dropped.modes) == 2
    assert "identify.further-modes" not in {n.code for n in dropped.found.notices}
    alone = identify(record, output=tmp_path / "one", methods=("SSI-cov",), **asked)
    assert "method" not in build_identification_page(alone).verdict
    monkeypatch.setattr(operational, "by_decomposition", whole)
    both = identify(record, output=tmp_path / "both", methods=("SSI-cov", "FDD"), **asked)
    assert "several methods found all modes" in build_identification_page(both).verdict
    assert "identify.one-method" not in {n.code for n in both.found.notices}


@pytest.mark.slow
def test_modes_with_negative_modal_mass_are_doubtful(tmp_path):
    frfs = accelerance(PLANT, np.linspace(0.5, 12.0, 300))
    reversed_force = replace(frfs, values=-frfs.values)
    write_uff_frfs(tmp_path / "frf.unv", ModalTest("t", SI, frfs=reversed_force))
    made = identify(tmp_path / "frf.unv", largest_order=8)
    assert [m.doubtful for m in made.record.modes] == [True] * 3
    assert all("negative modal mass" in m.remark for m in made.record.modes)
    assert "3 of them doubtful" in build_identification_page(made).verdict


@pytest.mark.slow
def test_means_over_fragments_show_the_collinearity_of_complex_shapes(record, tmp_path):
    text = 'sampling_hz = 50.0\nband_hz = [1.0, 12.0]\nlargest_order = 12\nfragments = 2\nmethods = ["FDD"]'
    made = identify(described(record, tmp_path, text))
    assert all(0.99 < m.phase_collinearity < 1.0 for m in made.record.modes)


def test_damping_that_is_not_known_is_told_of_records_of_responses_too(tmp_path):
    # three oscillators under white noise for so short a time that their damping cannot be told from zero
    rng, freq, rate, n = np.random.default_rng(3), np.array([4.0, 9.0, 14.0]), 60.0, 900
    poles = np.exp(2.0 * np.pi * freq * (-0.004 + 1j) / rate)
    modal = [lfilter([1.0], [1.0, -2.0 * p.real, abs(p) ** 2], rng.standard_normal(n)) for p in poles]
    values = np.array([[1.0, 0.7, 0.5], [0.8, -0.6, 0.9]]) @ modal
    np.savetxt(tmp_path / "r.csv", values.T, delimiter=",", header="1Z+,2Z+", comments="")
    made = identify(tmp_path / "r.csv", sampling_hz=rate, band_hz=(1.0, 25.0), largest_order=24, methods=("SSI-cov",))
    unknown = [m for m in made.record.modes if m.damping_sd and m.damping_ratio < 2.0 * m.damping_sd]
    assert unknown
    for m in unknown:
        assert m.doubtful
        assert "it may be noise" in m.remark
