"""Set-ups measured one after another: merged shapes, rigid floors, and the page that draws them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy import signal
from scipy.linalg import eigh
from tests.messages.shown import check_shown

from femtune import identify
from femtune.errors import FemtuneError
from femtune.files.uff import read_uff
from femtune.modal.shape_criteria import mac
from femtune.units import SI

POINTS, RATE = 12, 40.0
REFERENCES = (3, 11)
"""Positions of the reference sensors."""


def structure():
    """A cantilever of twelve points, as a chain with one stiffness that is different, and its modes."""
    springs = 4e3 * np.ones(POINTS)
    springs[5] *= 0.6
    stiffness = np.diag(springs + np.append(springs[1:], 0.0)) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)
    values, shapes = eigh(stiffness)
    return np.sqrt(values) / (2.0 * np.pi), shapes


def measured(rng, seconds):
    """Displacements, velocities and accelerations (points, samples) of the first six modes under random forces."""
    freq, shapes = structure()
    fine, n = 4, int(seconds * RATE) * 4
    q = {0: [], 1: [], 2: []}
    forces = shapes.T @ rng.standard_normal((POINTS, n))
    for k in range(6):
        w, zeta = 2.0 * np.pi * freq[k], 0.01
        for derivative, rows in q.items():
            numerator = [1.0] + [0.0] * derivative
            system = signal.cont2discrete((numerator, [1.0, 2 * zeta * w, w * w]), 1.0 / (fine * RATE), method="zoh")
            rows.append(signal.lfilter(np.ravel(system[0]), system[1], forces[k]))
    return {d: signal.decimate(shapes[:, :6] @ np.array(rows), fine, axis=1)[:, 200:] for d, rows in q.items()}


def written(folder, rng, setups, seconds, noise=0.02):
    """Records and the identification file of set-ups, each a list of (position, derivative, role)."""
    text = ["[identify]", "band_hz = [0.5, 15.0]", 'methods = ["SSI-cov"]', "largest_order = 30",
            f"sampling_hz = {RATE}", 'geometry = "points.csv"', f"lines = [{list(range(1, POINTS + 1))}]"]  # fmt: skip
    quantities = ("displacement", "velocity", "acceleration")
    for number, channels in enumerate(setups, 1):
        motion = measured(rng, seconds)
        values = np.array([motion[derivative][at] for at, derivative, _ in channels])
        values += noise * values.std(axis=1, keepdims=True) * rng.standard_normal(values.shape)
        # every set-up has its own gain, as amplifiers have
        np.save(folder / f"s{number}.npy", rng.uniform(0.5, 2.0) * values)
        text += ["[[setup]]", f'record = "s{number}.npy"']
        for column, (at, derivative, role) in enumerate(channels, 1):
            text += ["[[setup.channel]]", f"column = {column}", f'dof = "{at + 1}X+"', f'role = "{role}"',
                     f'quantity = "{quantities[derivative]}"']  # fmt: skip
    rows = [f"{i},0,0,{i}" for i in range(1, POINTS + 1)]
    (folder / "points.csv").write_text("node,x,y,z\n" + "\n".join(rows) + "\n")
    (folder / "identify.toml").write_text("\n".join(text) + "\n")
    return folder / "identify.toml"


def roving(count, overlap=False):
    """Two references of velocity and acceleration, and one roving sensor of alternating quantity in each set-up."""
    free = [i for i in range(POINTS) if i not in REFERENCES]
    out = []
    for k in range(count):
        at = [free[k % len(free)], *([free[(k + 1) % len(free)]] if overlap else [])]
        channels = [(REFERENCES[0], 1, "reference"), (REFERENCES[1], 2, "reference")]
        out.append([*channels, *((i, 1 + (k + j) % 2, "response") for j, i in enumerate(at))])
    return out


def check_merged(made, least, least_points):
    modes = read_uff(made.folder / "modes.uff", units=SI).test.modes
    freq, shapes = structure()
    assert modes.freq_hz == pytest.approx(freq[: len(modes)], rel=5e-3)
    assert len(modes) == 6
    at = [dof.node - 1 for dof in modes.dofs]
    assert len(at) >= least_points
    found = np.diag(mac(modes.shapes, shapes[at, :6]))
    assert found.min() >= least


@pytest.mark.slow
def test_roving_sensors_of_velocity_and_acceleration_become_whole_shapes(tmp_path):
    path = written(tmp_path, np.random.default_rng(0), roving(5, overlap=True), 300.0)
    made = identify(path)
    check_merged(made, 0.99, 8)
    data = json.loads((made.folder / "identified.json").read_text(encoding="utf-8"))
    assert [m["estimates"] for m in data["modes"]] == [5] * 6
    assert [m["freq_sd_hz"] > 0 for m in data["modes"]] == [True] * 6
    assert "Identified mode shapes" in made.report.read_text(encoding="utf-8")
    (told,) = [n for n in made.found.notices if n.code == "identify.likelihood"]
    assert told.facts["count"] >= 30
    assert 0 < told.facts["refined"] <= told.facts["count"]
    assert "of the set-ups" in told.what


@pytest.mark.long
def test_setups_side_by_side_are_those_one_after_another(tmp_path):
    path = written(tmp_path, np.random.default_rng(0), roving(2, overlap=True), 120.0)
    alone, both = (identify(path, output=tmp_path / str(jobs), jobs=jobs) for jobs in (1, 2))
    np.testing.assert_array_equal(both.modes.shapes, alone.modes.shapes)
    np.testing.assert_array_equal(both.modes.freq_hz, alone.modes.freq_hz)
    assert both.record.alerts == alone.record.alerts


def test_no_number_of_jobs(tmp_path):
    with pytest.raises(FemtuneError) as caught:
        identify(tmp_path / "identify.toml", jobs=0)
    check_shown("executor.jobs", caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("count", [6, pytest.param(15, marks=pytest.mark.long)])
def test_many_setups_have_the_true_shapes(tmp_path, count):
    """Merged shapes have a MAC of at least 0.999 with the truth."""
    points = min(POINTS, len(REFERENCES) + count)
    check_merged(identify(written(tmp_path, np.random.default_rng(0), roving(count), 1200.0)), 0.999, points)


@pytest.mark.slow
def test_setups_without_a_common_point_are_refused(tmp_path):
    setups = [[(i, 2, "response") for i in part] for part in ((0, 2, 11), (1, 3, 10))]
    with pytest.raises(FemtuneError, match="share no degree of freedom"):
        identify(written(tmp_path, np.random.default_rng(0), setups, 300.0))


@pytest.mark.slow
def test_sensors_of_a_floor_become_its_motions(tmp_path):
    """Four sensors on a rigid plate on springs: translations and the rotation about z, from records and places."""
    rng = np.random.default_rng(0)
    n, freq = 12_000, np.array([2.0, 3.1, 4.3])
    modes = []
    for f in freq:
        w = 2.0 * np.pi * f
        system = signal.cont2discrete(([1.0, 0.0, 0.0], [1.0, 0.02 * w, w * w]), 1.0 / RATE, method="zoh")
        modes.append(signal.lfilter(np.ravel(system[0]), system[1], rng.standard_normal(n)))
    shapes = np.array([[1.0, 0.2, 0.1], [0.1, 1.0, -0.3], [0.05, 0.1, 0.8]])
    motion = shapes @ np.array(modes)
    places = {11: (0.0, 0.0), 12: (4.0, 0.0), 13: (4.0, 3.0)}
    sensors = [(11, "X"), (11, "Y"), (12, "Y"), (13, "X")]
    x0, y0 = 1.5, 1.0
    rows = [
        [1.0, 0.0, -(places[node][1] - y0)] if along == "X" else [0.0, 1.0, places[node][0] - x0]
        for node, along in sensors
    ]
    np.save(tmp_path / "floor.npy", np.array(rows) @ motion + 1e-3 * rng.standard_normal((4, n)))
    points = [f"{node},{x},{y},0" for node, (x, y) in places.items()]
    (tmp_path / "points.csv").write_text(f"node,x,y,z\n1,{x0},{y0},0\n" + "\n".join(points) + "\n")
    channels = "".join(f'[[channel]]\ncolumn = {i}\ndof = "{n}{d}+"\n' for i, (n, d) in enumerate(sensors, 1))
    labels = ", ".join(f'"{node}{along}+"' for node, along in sensors)
    (tmp_path / "identify.toml").write_text(
        '[identify]\nrecord = "floor.npy"\nband_hz = [1.0, 6.0]\nmethods = ["SSI-cov"]\nlargest_order = 16\n'
        f'sampling_hz = {RATE}\ngeometry = "points.csv"\n[[rigid_body]]\nnode = 1\nsensors = [{labels}]\n{channels}'
    )
    found = identify(tmp_path / "identify.toml").modes
    assert found.dofs.labels() == ["1X+", "1Y+", "1RZ+"]
    assert found.freq_hz == pytest.approx(freq, rel=1e-2)
    assert np.diag(mac(found.shapes, shapes)).min() > 0.999
