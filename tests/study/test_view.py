"""femtune view: pictures of modes, and what is refused."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

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
    """The picture has the modes at the samples, in the order of those of the first; other samples, another picture."""
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
    ft.posterior(study)
    with pytest.raises(FemtuneError) as caught:
        ft.view(study, draws=0, picture=bench.folder / "none.png")
    check_shown("view.draws, number", caught.value)
    drawn = {}
    for draws in (1, 3):
        file = bench.folder / f"draws_{draws}.png"
        command = [sys.executable, "-m", "femtune", "view", str(study), "--mode", "1", "--draws", str(draws)]
        done = subprocess.run(
            [*command, "--picture", str(file)], capture_output=True, text=True, check=False, timeout=200
        )
        if done.returncode < 0:
            pytest.skip("VTK cannot draw on this machine")
        assert (done.returncode, done.stdout.splitlines()[-1]) == (0, f"picture: {file}")
        drawn[draws] = file.read_bytes()
    assert drawn[1] != drawn[3]


def test_a_deck_has_no_samples(beam: Bench) -> None:
    with pytest.raises(FemtuneError) as caught:
        ft.view(beam.folder / "beam.bdf", draws=3, picture=beam.folder / "none.png")
    check_shown("view.draws, deck", caught.value)
