"""The data of the page: what is unpacked from it is what the results hold."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
import pytest

from femtune.document.document import Document
from femtune.document.page_view import PageView, SceneView, quantised
from femtune.steps.report import view as views
from femtune.steps.report.view import in_phase, view_of
from femtune.steps.report_source import ReportSource
from femtune.steps.results import Results

from .packed import unpacked


@pytest.fixture(scope="module")
def view(document: Document) -> PageView:
    """That of the whole report."""
    assert document.view is not None
    return document.view


@pytest.fixture(scope="module")
def source(results: Results) -> ReportSource:
    """What the report is made of."""
    from .compared_data import all_arrays  # noqa: PLC0415

    return ReportSource(results, all_arrays())


def _scene(view: PageView, name: str = "BC") -> SceneView:
    return next(s for s in view.scenes if s.configuration == name)


def test_motion_and_points_are_those_of_the_results(view: PageView, source: ReportSource) -> None:
    kept = next(m for m in source.results.mode_shapes if m.configuration == "BC")
    scene = _scene(view)
    points, motion = source.array(kept.points_key), source.array(kept.translations_key)
    assert points is not None
    assert motion is not None
    used = np.unique(np.concatenate([unpacked(scene.lines), unpacked(scene.rigid)]).astype(int))
    assert len(used) == len(unpacked(scene.points))
    shown, stage = unpacked(scene.points), scene.stages[0]
    near = np.linalg.norm(points[None] - shown[:, None], axis=2).argmin(axis=1)
    np.testing.assert_allclose(shown, points[near], atol=2e-5 * np.ptp(points))
    found, columns = unpacked(stage.motion), list(stage.stored)
    largest = np.abs(motion[near][:, :, columns]).max(axis=(0, 1))
    assert (np.abs(found - motion[near][:, :, columns]).max(axis=(0, 1)) <= 1.6e-5 * largest).all()


def test_mac_and_pairs_are_those_of_the_comparison(view: PageView, source: ReportSource) -> None:
    scene = _scene(view)
    for stage in scene.stages:
        comparison = next(
            c for c in (source.before("BC"), source.after("BC")) if c and c.stage.split()[0] == stage.title
        )
        mac = source.array(comparison.mac_key)
        assert stage.mac is not None
        np.testing.assert_allclose(unpacked(stage.mac), mac, atol=1e-6)
        labels = [(scene.test_labels[p.test], p.column + 1) for p in stage.pairs]
        assert labels == [(p.test_label, p.model_number) for p in comparison.pairs]


def test_slopes_are_the_sensitivities_of_the_selection(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    names = data["selection"]["column_labels"]
    label = next(c for c in data["correlations"] if c["configuration"] == "BC")["mac_test_labels"][1]
    values = [0.01 * (i + 1) for i in range(len(names))]
    own = {"configuration": "BC", "test_label": label, "percent_per_percent": values}
    other = {**own, "configuration": "another", "percent_per_percent": [9.0] * len(names)}
    data["selection"]["sensitivities"] = [other, own]
    scene = _scene(view_of(ReportSource(Results.model_validate(data), arrays)))
    assert scene.parameters == tuple(names)
    assert scene.slopes == ((), tuple(values), *[()] * (len(scene.test_labels) - 2))


def test_the_factor_of_a_pair_is_its_modal_scale_factor(view: PageView, source: ReportSource) -> None:
    kept = [m for m in source.results.mode_shapes if m.configuration == "BC"][-1]
    test, seen = source.array(kept.test_shapes_key), source.array(kept.model_at_sensors_key)
    assert test is not None
    assert seen is not None
    for pair in _scene(view).stages[-1].pairs:
        t = np.nan_to_num(test[:, pair.test]).astype(float)
        m = seen[:, [n - 1 for n in pair.modes]].astype(float) @ pair.weights
        assert pair.factor == pytest.approx((t @ m / (t @ t), 0.0))


def test_the_motion_of_places_agrees_with_the_sensors(view: PageView, source: ReportSource) -> None:
    kept = [m for m in source.results.mode_shapes if m.configuration == "BC"][-1]
    keys = (kept.sensor_positions_key, kept.sensor_directions_key, kept.sensor_rotations_key, kept.test_shapes_key)
    seats, directions, rotations, test = (np.asarray(source.array(k)) for k in keys)
    scene = _scene(view)
    assert scene.places is not None
    assert scene.test is not None
    places, motion = unpacked(scene.places), unpacked(scene.test)
    for seat, along, turns, values in zip(seats, directions, rotations, test):
        if turns or not np.isfinite(seat).all():
            continue
        at = np.linalg.norm(places - seat, axis=1).argmin()
        np.testing.assert_allclose(along @ motion[at], values, atol=1e-4 * np.nanmax(np.abs(test)))


def test_a_complex_shape_is_turned_to_its_largest_real_part() -> None:
    real = np.array([1.0, -2.0, 0.5])
    found = in_phase(real * np.exp(0.7j))
    np.testing.assert_allclose(np.abs(found), np.abs(real), rtol=1e-12)
    assert in_phase(real) is real


def test_complex_test_shapes_are_kept(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    kept = [m for m in data["mode_shapes"] if m["configuration"] == "BC"][-1]
    real = arrays[kept["test_shapes_key"]]
    turned = real * np.exp(0.5j)
    found = view_of(ReportSource(Results.model_validate(data), arrays | {kept["test_shapes_key"]: turned}))
    scene = _scene(found)
    assert scene.test is not None
    assert scene.test_imaginary is not None
    plain = _scene(view_of(ReportSource(Results.model_validate(data), arrays))).test
    assert plain is not None
    both = unpacked(scene.test) + 1j * unpacked(scene.test_imaginary)
    np.testing.assert_allclose(both, unpacked(plain) * np.exp(0.5j), atol=1e-4 * np.abs(both).max())
    # the factor undoes the turn: what is shown is in phase with the real shape of the model
    for pair in scene.stages[-1].pairs:
        assert np.angle(complex(*pair.factor)) % np.pi == pytest.approx(np.pi - 0.5, abs=1e-6)


def test_the_history_has_all_iterations(view: PageView, results: Results) -> None:
    assert view.history is not None
    assert results.update is not None
    assert view.history.values == tuple(i.parameters for i in results.update.history)


def test_quantised_values_keep_their_sign_and_zero() -> None:
    values = np.array([[1.0, -3e-9], [0.0, 0.0], [-0.5, 1e-9]])
    assert (np.abs(unpacked(quantised(values)) - values) <= 1.6e-5 * np.abs(values).max(axis=0)).all()
    assert unpacked(quantised(values))[1].tolist() == [0.0, 0.0]


def test_text_cannot_leave_the_script_element(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    probe = "</script><!--<script>&"
    for c in data["correlations"]:
        renamed = {label: label + probe for label in c["mac_test_labels"]}
        c["mac_test_labels"] = list(renamed.values())
        c["pairs"] = [{**p, "test_label": renamed[p["test_label"]]} for p in c["pairs"]]
    text = view_of(ReportSource(Results.model_validate(data), arrays)).json()
    assert not set("<>&") & set(text)
    assert any(probe in label for scene in json.loads(text)["scenes"] for label in scene["test_labels"])


def _large(count: int, modes: int, data: dict[str, Any]) -> tuple[Results, dict[str, Any]]:
    """Results of a plate of count × count elements with so many modes."""
    side = np.arange(count + 1.0)
    x, y = np.meshgrid(side, side, indexing="ij")
    row = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    faces = np.stack([row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]], axis=-1).reshape(-1, 4)
    waves = np.arange(1, modes + 1)
    motion = np.zeros((row.size, 3, modes))
    motion[:, 2] = np.sin(np.pi * waves * x.reshape(-1, 1) / count) * np.sin(np.pi * y.reshape(-1, 1) / count)
    arrays = {
        "points": np.column_stack([x.ravel(), y.ravel(), 0.0 * x.ravel()]), "lines": np.zeros((0, 2), np.int32),
        "kinds": np.zeros(0, np.int8), "faces": faces, "motion": motion.astype(np.float32),
    }  # fmt: skip
    kept = {
        "configuration": "BC", "stage": "before", "points_key": "points", "lines_key": "lines",
        "line_kinds_key": "kinds", "faces_key": "faces", "translations_key": "motion",
    }  # fmt: skip
    of_modes = next(m for m in data["modes"] if m["configuration"] == "BC" and m["stage"] == "before")
    data |= {"mode_shapes": [kept], "modes": [{**of_modes, "freq_hz": list(map(float, waves))}]}
    data |= {"correlations": [], "responses": []}
    return Results.model_validate(data), arrays


@pytest.mark.parametrize("modes", [pytest.param(50, marks=pytest.mark.slow), 10])
def test_a_large_mesh_stays_within_its_bytes(data: dict[str, Any], modes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(views, "MOTION_BYTES", 400_000)
    results, arrays = _large(120, modes, data)
    found = view_of(ReportSource(results, arrays))
    (scene,) = found.scenes
    assert 0 < len(scene.stages[0].stored) <= modes
    assert len(base64.b64decode(scene.stages[0].motion.data)) <= 400_000
    assert "simplified" in scene.note
    assert ("not stored" in scene.note) == (len(scene.stages[0].stored) < modes)
