"""femtune view: pictures of modes, and what is refused."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError

from .cantilever import EI, TRUE, Bench


@pytest.fixture(autouse=True)
def _libraries() -> None:
    pytest.importorskip("pyvista", reason="the extra view is not installed")
    pytest.importorskip("meshio", reason="the extra view is not installed")


@pytest.mark.parametrize(
    "modes", [pytest.param(("1", "2"), marks=pytest.mark.slow), pytest.param(("2", "2"), marks=pytest.mark.long)]
)
def test_another_mode_is_another_picture(beam: Bench, modes: tuple[str, str]) -> None:
    deck, drawn = str(beam.folder / "beam.bdf"), []
    for mode in modes:
        file = beam.folder / f"mode_{len(drawn)}.png"
        command = [
            sys.executable,
            "-m",
            "femtune",
            "view",
            deck,
            "--count",
            "2",
            "--mode",
            mode,
            "--picture",
            str(file),
        ]
        # a process of its own: where VTK finds no driver at all, it ends the process
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)
        if done.returncode < 0:
            pytest.skip("VTK cannot draw on this machine")
        assert (done.returncode, done.stdout.splitlines()[-1]) == (0, f"picture: {file}")
        drawn.append(file.read_bytes())
    assert drawn[0].startswith(b"\x89PNG")
    assert (drawn[0] == drawn[1]) == (modes[0] == modes[1])


def test_without_a_screen(beam: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    with pytest.raises(FemtuneError) as caught:
        ft.view(beam.folder / "beam.bdf")
    check_shown("view.no-screen", caught.value)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("asked", "name"),
    [
        ({"picture": "mode.jpg"}, "view.picture, suffix"),
        ({"picture": "nowhere/mode.png"}, "view.picture, no folder"),
        ({"picture": "mode.png", "mode": 9, "count": 2}, "view.mode"),
        ({"picture": "mode.png", "configuration": "launch", "count": 2}, "study.unknown-configuration, of a picture"),
    ],
)
def test_what_cannot_be_shown(
    beam: Bench, monkeypatch: pytest.MonkeyPatch, asked: dict[str, object], name: str
) -> None:
    monkeypatch.chdir(beam.folder)
    with pytest.raises(FemtuneError) as caught:
        ft.view("beam.bdf", **asked)
    check_shown(name, caught.value)
    assert not Path("mode.png").exists()


@pytest.mark.slow
def test_modes_at_samples_of_the_posterior(bench: Bench) -> None:
    """The picture has the shapes at the samples, and states their lowest and highest frequency."""
    bench.write("beam.bdf", bench.text)
    bench.uff(bench.measure(bench.truth(TRUE)))
    plain = f"{EI}\n[residuals]\nfrequency_sd = 0.02\n"
    study = bench.study(plain)
    with pytest.raises(FemtuneError) as caught:
        ft.view(study, draws=3, picture=bench.folder / "none.png")
    assert caught.value.code == "run.missing"
    ft.update(study)
    with pytest.raises(FemtuneError) as caught:
        ft.view(study, draws=3, picture=bench.folder / "none.png")
    check_shown("view.draws", caught.value)
    study = bench.study(f'{plain}[posterior]\nnoise = "stated"\ndraws = 100\nstarts = 0\n')
    sampled = ft.posterior(study)
    with pytest.raises(FemtuneError) as caught:
        ft.view(study, draws=0, picture=bench.folder / "none.png")
    check_shown("view.draws, number", caught.value)
    drawn = {draws: _drawn(study, draws, bench.folder / f"draws_{draws}.png") for draws in (1, 3)}
    # every third of the weights has its sample, solved here by a deck with its values
    record = sampled.results.posterior
    assert record is not None
    samples, weights = (sampled.arrays[key] for key in (record.samples_key, record.weights_key))
    middle = [np.searchsorted(np.cumsum(weights), (k + 0.5) / 3.0 * weights.sum()) for k in range(3)]
    fields = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1"}
    hz = []
    for k, row in enumerate(middle):
        values = {fields[name]: _I1 * factor for name, factor in zip(record.free, samples[row])}
        deck = ft.write_deck(bench.folder / "beam.bdf", values, bench.folder / f"sample_{k}.bdf", wide=True)
        hz.append(ft.modes(deck, count=1).freq_hz[0])
    said = [float(text) for text in re.findall(r"([\d.]+) Hz", drawn[3]["title"])]
    assert drawn[3]["title"].startswith("3 samples of the posterior: ")
    assert said == pytest.approx([min(hz), max(hz)], rel=1e-3)
    assert max(hz) > 1.002 * min(hz)
    # the shape of each sample moves as far, and not along the same line
    assert (len(drawn[1]["moved"]), len(drawn[3]["moved"])) == (1, 3)
    first, *others = (np.array(points) for points in drawn[3]["moved"])
    for points in others:
        assert np.abs(points).max() == pytest.approx(np.abs(first).max(), rel=1e-6)
        assert 0.0 < np.abs(points - first).max() < 0.2 * np.abs(first).max()
    assert all((bench.folder / f"draws_{draws}.png").read_bytes().startswith(b"\x89PNG") for draws in (1, 3))


_I1 = 2e-7
"""Second moment of area in the deck."""

_SPY = """
import json, sys
import numpy as np, pyvista
import femtune as ft
said = {"title": "", "moved": []}
class Plotter(pyvista.Plotter):
    def add_text(self, text, **more):
        said["title"] = text
        return super().add_text(text, **more)
    def add_mesh(self, mesh, **more):
        if more.get("style") == "wireframe":
            self._at_rest = np.array(mesh.points)
        else:
            said["moved"].append((np.array(mesh.points) - self._at_rest).tolist())
        return super().add_mesh(mesh, **more)
pyvista.Plotter = Plotter
ft.view(sys.argv[1], mode=1, draws=int(sys.argv[2]), picture=sys.argv[3])
print(json.dumps(said))
"""


def _drawn(study: Path, draws: int, file: Path) -> dict[str, Any]:
    """Title and displacements of a picture, from a process of its own."""
    command = [sys.executable, "-c", _SPY, str(study), str(draws), str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=200)
    if done.returncode < 0:
        pytest.skip("VTK cannot draw on this machine")
    assert done.returncode == 0, done.stderr
    said: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return said


def test_a_deck_has_no_samples(beam: Bench) -> None:
    with pytest.raises(FemtuneError) as caught:
        ft.view(beam.folder / "beam.bdf", draws=3, picture=beam.folder / "none.png")
    check_shown("view.draws, deck", caught.value)
