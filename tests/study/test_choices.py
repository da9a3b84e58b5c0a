"""Poles that a person picks: the same modes again, names, refusals, and a page where no mode was chosen."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.signal import lfilter
from tests.reporting.packed import unpacked as numbers_of

import femtune as ft
from femtune.cli import main
from femtune.document.page_view import Packed
from femtune.steps.identify import STEP
from femtune.steps.identify.request import asked_of

pytestmark = pytest.mark.slow

RATE, T = 40.0, np.arange(4000) / 40.0
FREQ, SHAPES = np.array([2.1, 5.3, 8.9]), np.array([[0.3, 0.6, 0.9], [0.9, 0.4, -0.6], [0.7, -0.9, 0.5]])
AMBIENT = {"band_hz": (1.0, 12.0), "sampling_hz": RATE, "largest_order": 16, "methods": ("SSI-cov",)}
FORCED = {"band_hz": (1.0, 12.0), "sampling_hz": RATE, "largest_order": 12, "methods": ("N4SID",)}


def unpacked(array: dict) -> np.ndarray:
    return numbers_of(Packed(**array))


def responses(force: np.ndarray) -> np.ndarray:
    """(3, samples) accelerations of three modes with a damping ratio of 1 %; force (3, samples)."""
    out = np.zeros((3, T.size))
    for f, shape in zip(FREQ, SHAPES):
        pole = np.exp(2.0 * np.pi * f * (-0.01 + 1j) / RATE)
        out += np.outer(shape, lfilter([1.0, -2.0, 1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], shape @ force))
    return out + 0.02 * out.std() * np.random.default_rng(9).standard_normal(out.shape)


def of_page(folder) -> dict:
    """The data of the diagram on the page of a folder."""
    text = (folder / "report.html").read_text(encoding="utf-8")
    return json.loads(re.search(r'id="view">(.*?)</script>', text, re.S)[1])["stabilisation"]


def write_choice(path, view, rows, names=()):
    """The file that the page saves for some of its poles."""
    freq, damping, order, method = (unpacked(view[k]) for k in ("freq_hz", "damping_ratio", "order", "method"))
    lines = ["schema_version = 1"]
    for one in view["inputs"]:
        lines += ["[[input]]", f'path = "{one["path"]}"', f'sha256 = "{one["sha256"]}"']
    for i, (row, fit_only) in enumerate(rows):
        lines += ["[[mode]]", f'method = "{view["methods"][int(method[row])]}"', f"order = {int(order[row])}"]
        lines += [f"freq_hz = {float(freq[row]):.8g}", f"damping_ratio = {float(damping[row]):.8g}"]
        lines += [f'name = "{name}"' for name in names[i : i + 1]] + ["fit_only = true"] * fit_only
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def picked(view):
    return [(one["row"], one["fit_only"]) for one in view["picked"]]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder, rng = tmp_path_factory.mktemp("choices"), np.random.default_rng(3)
    np.save(folder / "ambient.npy", responses(rng.standard_normal((3, T.size))).T)
    force = np.zeros((3, T.size))
    force[0] = rng.standard_normal(T.size)
    table = np.column_stack([force[0], responses(force).T])
    np.savetxt(folder / "forced.csv", table, delimiter=",", header="force,1Z+,2Z+,3Z+", comments="")
    ambient = ft.identify(folder / "ambient.npy", output=folder / "a", **AMBIENT)
    forced = ft.identify(folder / "forced.csv", output=folder / "f", **FORCED)
    return folder, ambient, forced


@pytest.mark.parametrize("kind", ["ambient.npy", "forced.csv"])
def test_the_choice_of_the_page_gives_the_same_modes(made, kind):
    folder, ambient, forced = made
    before, asked = (ambient, AMBIENT) if kind == "ambient.npy" else (forced, FORCED)
    view = of_page(before.folder)
    choice = write_choice(folder / f"{kind}.toml", view, picked(view), names=[f"m{i}" for i in range(9)])
    after = ft.identify(folder / kind, output=folder / "again", choices=choice, **asked)
    # the file has eight digits, by which the pole of the table is found: the modes are the same to the last digit
    np.testing.assert_array_equal(after.modes.freq_hz, before.modes.freq_hz)
    np.testing.assert_array_equal(after.modes.freq_sd_hz, before.modes.freq_sd_hz)
    np.testing.assert_array_equal(after.modes.shapes, before.modes.shapes)
    assert after.modes.labels == tuple(f"m{i}" for i in range(len(after.modes)))
    assert picked(of_page(folder / "again")) == picked(view)


def test_behind_the_diagram_are_singular_values_and_what_a_synthesis_is_fitted_to(made):
    _, ambient, forced = made
    for found, derivatives, functions in ((ambient, -1, 0), (forced, 2, 3)):
        view = of_page(found.folder)
        singular, curve = unpacked(view["singular_db"]), unpacked(view["curve_db"])
        assert (view["derivatives"], view["functions"], view["decay"]) == (derivatives, functions, 0.0)
        assert (np.diff(singular, axis=0) <= 1e-4).all()
        # the first one is nearly all of what there is
        assert (singular[0] <= curve + 1e-4).all()
        assert np.abs(singular[0] - curve).max() < 3.0
    power = unpacked(of_page(ambient.folder)["power"])
    level = 10.0 ** (0.1 * unpacked(of_page(ambient.folder)["singular_db"]))
    np.testing.assert_allclose(power, level.sum(axis=0) / level.sum(axis=0).max(), rtol=1e-5)
    assert not unpacked(of_page(forced.folder)["power"]).size


def test_a_pole_that_became_two_modes_is_picked_once_and_becomes_two_again(tmp_path):
    rng, freq, count = np.random.default_rng(5), np.array([2.1, 5.3, 5.315]), 14000
    shapes, out = rng.uniform(0.3, 1.0, (3, 3)) * rng.choice((-1.0, 1.0), (3, 3)), np.zeros((3, count))
    force = rng.standard_normal((3, 5)) @ rng.standard_normal((5, count))
    for f, shape, one in zip(freq, shapes.T, force):
        pole = np.exp(2.0 * np.pi * f * (-0.01 + 1j) / RATE)
        out += np.outer(shape, lfilter([1.0, -2.0, 1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], one))
    out += 0.02 * out.std(axis=1, keepdims=True) * rng.standard_normal(out.shape)
    np.save(tmp_path / "pair.npy", out[:, 2000:].T)
    before = ft.identify(tmp_path / "pair.npy", output=tmp_path / "a", **AMBIENT)
    view = of_page(before.folder)
    rows = picked(view)
    assert len(set(rows)) == len(rows) == len(before.modes) - 1
    choice = write_choice(tmp_path / "pair.toml", view, rows)
    after = ft.identify(tmp_path / "pair.npy", output=tmp_path / "b", choices=choice, **AMBIENT)
    np.testing.assert_array_equal(after.modes.freq_hz, before.modes.freq_hz)
    np.testing.assert_array_equal(after.modes.shapes, before.modes.shapes)


def test_poles_that_the_rule_does_not_choose_can_be_picked_and_modes_be_dropped(made):
    folder, ambient, _ = made
    view = of_page(ambient.folder)
    stable, rows = unpacked(view["stable"]), picked(view)
    alone = next(i for i in range(len(stable)) if not stable[i] and 0.0 < unpacked(view["damping_ratio"])[i] < 0.2)
    choice = write_choice(folder / "other.toml", view, [rows[0], (alone, False)])
    after = ft.identify(folder / "ambient.npy", output=folder / "other", choices=choice, **AMBIENT)
    wanted = sorted(float(unpacked(view["freq_hz"])[row]) for row in (rows[0][0], alone))
    # refined by maximum likelihood from the poles
    np.testing.assert_allclose(after.modes.freq_hz, wanted, rtol=2e-3)


def test_a_choice_that_does_not_fit_is_refused(made, tmp_path):
    folder, ambient, _ = made
    view = of_page(ambient.folder)
    rows = picked(view)
    fits = write_choice(folder / "fits.toml", view, rows)

    def refused(path=folder / "ambient.npy", choice=fits, **changed):
        with pytest.raises(ft.FemtuneError) as caught:
            ft.identify(path, output=tmp_path / "out", choices=choice, **{**AMBIENT, **changed})
        return caught.value

    other = np.load(folder / "ambient.npy")
    other[0, 0] += 1e-9
    np.save(tmp_path / "ambient.npy", other)
    shown = {
        "identify.choices": refused(tmp_path / "ambient.npy"),
        "identify.choices/no-pole": refused(largest_order=4),
        "identify.choices/twice": refused(choice=write_choice(tmp_path / "b.toml", view, [rows[0]] * 2)),
        "identify.choices/names": refused(choice=write_choice(tmp_path / "c.toml", view, rows, names="aaa")),
        "identify.choices/method": refused(methods=("ERA",)),
        "identify.choices/with-others": refused(take_hz=(2.1,)),
    }
    assert {error.code for error in shown.values()} == {"identify.choices"}
    for code in ("identify.choices", "identify.choices/with-others"):
        assert shown[code].where is not None
    assert "two modes of the choice have the name 'a'" in str(shown["identify.choices/names"])
    assert "changed = ambient.npy" in str(shown["identify.choices"])


def test_a_file_of_choices_without_modes_is_refused_before_anything_is_computed(tmp_path):
    np.save(tmp_path / "r.npy", np.random.default_rng(1).standard_normal((3, 64)))
    (tmp_path / "choices.toml").write_text(f'[[input]]\npath = "r.npy"\nsha256 = "{"0" * 64}"\n')
    # so short a record is an error of the methods
    options = {"choices": str(tmp_path / "choices.toml"), "band_hz": (1.0, 20.0), "sampling_hz": 50.0}
    with pytest.raises(ft.FemtuneError) as error:
        ft.identify(tmp_path / "r.npy", output=tmp_path / "out", **options)
    assert error.value.what == "the choices file lacks the key 'mode'"
    assert error.value.hint == "add a table [[mode]]"


def test_without_a_mode_the_page_has_the_poles_to_pick_from(made):
    """Noise has no mode; poles that are picked on its page are taken, also from the command line."""
    folder = made[0]
    np.save(folder / "noise.npy", np.random.default_rng(0).standard_normal((3000, 3)))
    out, args = folder / "none", ["--rate", "40", "--band", "1", "12", "--order", "12", "--method", "SSI-cov"]
    shutil.copytree(made[1].folder, out)
    failed = CliRunner().invoke(main, ["identify", str(folder / "noise.npy"), *args, "--output", str(out)])
    assert failed.exit_code != 0
    assert "report.html" in failed.output
    assert not (out / "modes.uff").exists(), "modes of an earlier identification must not stay"
    view = of_page(out)
    assert view["picked"] == []
    row = int(np.argmax(unpacked(view["damping_ratio"]) > 0.0))
    choice = write_choice(folder / "of_noise.toml", view, [(row, False)])
    command = ["identify", str(folder / "noise.npy"), *args, "--output", str(out), "--choices", str(choice)]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 0, done.output
    made_modes = json.loads((out / "identified.json").read_text(encoding="utf-8"))["modes"]
    assert [m["freq_hz"] for m in made_modes] == pytest.approx([float(unpacked(view["freq_hz"])[row])], rel=1e-6)


def test_windows_and_further_hits_are_options_of_the_command_line(tmp_path, monkeypatch):
    """Relative names of further records are those of the working folder, and not of the folder of the first one."""
    for name in ("hits/hit0.csv", "more/hit1.csv", "more/hit2.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("force,1Z+\n1,2\n3,4\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path / "more")
    params = {option: p.name for p in STEP.command.params for option in p.opts}
    words = {"--record": ("hit1.csv", "hit2.csv"), "--exponential": 0.5, "--force-window": 0.01}
    asked = asked_of(tmp_path / "hits/hit0.csv", {params[option]: value for option, value in words.items()})
    assert [path.resolve() for path in asked.measured_paths] == [
        tmp_path / "hits/hit0.csv",
        tmp_path / "more/hit1.csv",
        tmp_path / "more/hit2.csv",
    ]
    assert (asked.identify.exponential_s, asked.identify.force_window_s) == (0.5, 0.01)
