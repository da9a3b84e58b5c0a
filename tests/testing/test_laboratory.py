"""The simulated laboratory answers as the structures in it must."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.dofs import Dof, DofSet
from femtune.model import Configuration, configure, damping_by_mode, parametric_model, solve_modes
from femtune.model.response import frf, make_ports
from femtune.parameters import ParameterSet
from structures.braced_building import braced_building
from structures.frames import make_structure, scalars
from structures.laboratory import (
    Clock,
    MeasuringChain,
    accelerance,
    accelerations,
    burst_random,
    chirp,
    multisine,
    narrow_line,
    plant_of_matrices,
    plant_of_model,
    record,
    simulated_test,
    stepped_sine,
    white_noise,
    with_sensor_masses,
)

DOFS = DofSet([Dof(1, "X"), Dof(2, "X")])
STIFFNESS = np.array([[800.0, -400.0], [-400.0, 400.0]])


def two_masses(ratio: float = 0.01):
    return plant_of_matrices(np.eye(2), STIFFNESS, ratio, np.eye(2), DOFS, np.eye(2), DOFS)


def test_the_truth_of_two_masses_is_the_closed_form():
    golden = np.array([(3.0 - np.sqrt(5.0)) / 2.0, (3.0 + np.sqrt(5.0)) / 2.0])
    assert two_masses().truth.freq_hz == pytest.approx(np.sqrt(400.0 * golden) / (2.0 * np.pi), rel=1e-12)


def test_steady_state_under_a_multisine_is_the_accelerance():
    plant, rng, step, count = two_masses(), np.random.default_rng(1), 0.01, 4000
    lines = np.arange(20, 300, 7)
    force = multisine(rng, lines, count, periods=6)
    motion = accelerations(plant, np.vstack([force, 0.0 * force]), step)
    last = np.fft.rfft(motion[:, -count:], axis=1)[:, lines] / np.fft.rfft(force[-count:])[lines]
    exact = accelerance(plant, lines / (count * step)).values[:, 0]
    # a sine of straight pieces has sinc² of its size; the rest of the samples are far faster waves, which act on the
    # mass alone
    share = np.sinc(lines / count) ** 2
    inverse_mass = np.array([[1.0], [0.0]])
    assert np.abs(last - exact * share - inverse_mass * (1.0 - share)).max() < 2e-4


def test_accelerance_of_a_model_is_that_of_the_response_floor():
    springs = scalars("spring", [[0, 6], [6, -1], [0, -1]], "K", [400.0, 100.0, 300.0])
    structure = make_structure(np.zeros((2, 3)), [springs, scalars("scalar-mass", [[0, -1], [6, -1]], "M", [1.0, 2.0])])
    supports = ((1, "23456"), (2, "23456"))
    model = parametric_model(structure, ParameterSet(()), ())
    configured = configure(model, Configuration(supports_added=supports))
    modes = solve_modes(configured.at(np.zeros(0)), 2)
    ports = make_ports(configured, ["1X+"], ["1X+", "2X-"])
    lines = np.linspace(0.5, 6.0, 40)
    ours = accelerance(plant_of_model(modes, ports, 0.02), lines)
    ratios = np.full(2, 0.02)
    theirs = frf(modes, ports, lines, damping=damping_by_mode(ratios), residual_vectors=False)
    assert ours.values == pytest.approx(theirs.values, rel=1e-10)
    assert ours.responses == theirs.responses


def test_the_building_without_braces_has_the_published_nominal_frequencies():
    # solved by another program from a deck of the same frame
    published = {
        "BC": (3.1788, 3.9471, 5.5226, 9.6459, 14.4232, 18.1435),
        "NC": (2.9412, 3.6371, 5.2442, 8.9290, 13.2689, 17.2886),
        "SC": (2.7519, 3.4168, 4.9316, 8.3563, 12.4957, 16.2420),
    }
    for name, freq_hz in published.items():
        assert braced_building(name, brace_mass=0.0).plant.truth.freq_hz == pytest.approx(freq_hz, rel=2e-4)


@pytest.mark.parametrize("name", ["BC", "NC", "SC"])
def test_the_braces_split_the_fourth_mode_and_leave_the_others(name):
    bare, braced = (braced_building(name, m).plant.truth.freq_hz for m in (0.0, 140.0))
    assert len(braced) == 7
    assert braced[3] < bare[3] < braced[4]
    assert braced[[0, 1, 2, 5, 6]] == pytest.approx(bare[[0, 1, 2, 4, 5]], rel=1e-3)


def test_the_left_peak_grows_as_the_building_gets_heavier():
    # as the frequency ratio of the appendage to the frame rises, the lower of the two modes takes the frame's part
    def share(name: str) -> float:
        shapes = braced_building(name).plant.truth.shapes
        return float((shapes[:, 3] ** 2).sum() / (shapes[:, 4] ** 2).sum())

    assert share("BC") < share("NC") < share("SC")


def test_ground_carries_a_rigid_building_along():
    plant = braced_building("NC").plant
    at_rest = accelerance(plant, np.array([1e-3])).values[:, :, 0]
    assert at_rest[:, 0].real == pytest.approx(np.tile([1.0, 0.0], 4), abs=1e-6)
    assert at_rest[:, 1].real == pytest.approx(np.tile([0.0, 1.0], 4), abs=1e-6)


def test_chain_adds_the_noise_that_was_asked_for_and_rounds():
    rng = np.random.default_rng(3)
    motion = rng.standard_normal((2, 100_000)) * np.array([[1.0], [5.0]])
    noise = record(np.random.default_rng(0), MeasuringChain(20.0), motion) - motion
    assert noise.std(axis=1) / motion.std(axis=1) == pytest.approx([0.1, 0.1], rel=0.02)
    rounded = record(np.random.default_rng(0), MeasuringChain(np.inf, bits=6, range_rms=2.0), motion)
    assert len(np.unique(rounded)) <= 2**6 + 1
    assert np.abs(rounded).max() == pytest.approx(2.0 * motion.std(axis=1).max())


def test_record_of_a_shaker_has_force_and_responses_on_one_clock():
    clock = Clock(duration_s=20.0, sampling_hz=50.0, settle_s=2.0)
    force = white_noise(np.random.default_rng(2), 2, clock.fine_samples)
    made = simulated_test(two_masses(), force, clock, MeasuringChain(np.inf), 0, measured_inputs=(0,))
    assert made.samples == 1000
    assert made.dofs("response") == DOFS
    assert [str(d) for d in made.dofs("input")] == ["1X+"]
    again = simulated_test(two_masses(), force, clock, MeasuringChain(np.inf), 0, measured_inputs=(0,))
    assert (made.values == again.values).all()


def test_stepped_sine_scatters_around_the_truth():
    lines = np.geomspace(1.0, 8.0, 4000)
    made = stepped_sine(two_masses(), lines, 1, noise_db=40.0, seed=5)
    exact = accelerance(two_masses(), lines).values[:, [1]]
    error = np.abs(made.values - exact).std(axis=2) / np.sqrt((np.abs(exact) ** 2).mean(axis=2))
    assert np.sqrt((np.abs(made.values - exact) ** 2).mean(axis=2)) == pytest.approx(
        0.01 * np.sqrt((np.abs(exact) ** 2).mean(axis=2)), rel=0.05
    )
    assert error.max() < 0.01


def test_sensor_masses_sit_once_on_every_node():
    sensors = DofSet([Dof(4, "X"), Dof(4, "Z"), Dof(9, "Y")])
    loaded = with_sensor_masses(Configuration(), sensors, 0.02)
    assert [(m.node, m.mass) for m in loaded.masses] == [(4, 0.02), (9, 0.02)]


def test_signals_are_what_their_names_say():
    rng, step = np.random.default_rng(0), 0.005
    hum = narrow_line(rng, 40_000, step, 7.8, 0.05, 2.0)
    power = np.abs(np.fft.rfft(hum)) ** 2
    freq = np.fft.rfftfreq(40_000, step)
    near = np.abs(freq - 7.8) < 0.5
    assert hum.std() == pytest.approx(2.0)
    assert power[near].sum() > 0.95 * power.sum()
    swept = chirp(4000, step, 1.0, 20.0, periods=2)
    assert (swept[:4000] == swept[4000:]).all()
    burst = burst_random(rng, 1000, 3, share=0.5).reshape(3, 1000)
    assert (burst[:, 500:] == 0.0).all()
    assert (burst[:, :500] != 0.0).all()
