"""FRFs of the live model: those of decks at points that nobody has solved before, their χ², and why there are none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import femtune as ft
from femtune.files.uff import write_uff_frfs
from femtune.model import constant_damping
from femtune.reporting.html import html_text
from femtune.steps.live.record import LiveConfiguration
from femtune.steps.live.stored import stored_functions, stored_model
from femtune.steps.report.build import build_report
from femtune.steps.run.result import RunResult
from femtune.testdata import ModalTest
from femtune.units import SI

from .cantilever import CANTILEVER, Bench, bounded, fine, with_factors
from .damped_cantilever import functions

pytestmark = pytest.mark.slow

_EI = f"\n{bounded('root', 'PBAR 1 I1')}\n{bounded('tip', 'PBAR 2 I1')}\n"
_FRF = '[[residual]]\nkind = "frf"\nratio = 0.01\nsd = 0.05\n'
_DAMPING = constant_damping(0.01)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    made = Bench(tmp_path_factory.mktemp("live_functions"))
    made.write("beam.bdf", CANTILEVER)
    truth = made.truth()
    modes = made.uff(made.measure(truth))
    frfs = made.functions(functions(truth, noise=0.002, damping=_DAMPING))
    made.write("both.uff", modes.read_text() + frfs.read_text())
    return made


@pytest.fixture(scope="module")
def compared(bench: Bench) -> RunResult:
    return ft.run(bench.study(_EI + _FRF, test="frfs.uff"), output=bench.folder / "compared")


def _only(run: RunResult) -> LiveConfiguration:
    live = run.results.live
    assert live is not None
    assert live.reason == ""
    (one,) = live.configurations
    return one


def _apart(run: RunResult, folder: Path, text: str, points: int = 10, **options: Any) -> float:
    """Largest difference of a function at random points from that of a deck of its own, in %."""
    live, one, worst = run.results.live, _only(run), 0.0
    assert live is not None
    model = stored_model(live, one.configuration, run.arrays)
    (ports,) = stored_functions(live, one.configuration, run.arrays)
    for i, (root, tip) in enumerate(np.random.default_rng(3).uniform(0.5, 2.0, (points, 2)).round(3)):
        deck = folder / f"function_{i}.bdf"
        deck.write_text(with_factors(text, root, tip), encoding="ascii")
        exact = functions(deck, damping=_DAMPING, **options).values
        found = ports.values(model, np.array([root, tip]) - 1.0)
        size = np.linalg.norm(exact, axis=2)
        seen = size > 1e-6 * size.max()
        worst = max(worst, float((np.linalg.norm(found - exact, axis=2)[seen] / size[seen]).max()))
    return 100.0 * worst


def test_compared_functions_are_those_of_decks(compared: RunResult, bench: Bench) -> None:
    one = _only(compared)
    (f,) = one.functions
    assert one.functions_reason == ""
    assert (f.label, f.look, f.every, f.damping_ratios) == ("frf", "test", 1, (0.01,))
    assert f.region is not None
    assert f.bounds is not None
    assert (f.region.points, f.bounds.points) == (4, 4)
    names = [f"{output} by {of_input}" for output in f.outputs for of_input in f.inputs]
    assert f.region.function in names
    assert f.bounds.function in names
    assert _apart(compared, bench.folder, CANTILEVER) < 0.01
    assert f.bounds.percent < 0.01
    # their frequencies are the model's own: the test has no modes
    assert one.test_labels == one.pairs == ()


def test_chi_square_of_the_functions_is_that_of_the_update(compared: RunResult) -> None:
    live, update = compared.results.live, compared.results.update
    assert live is not None
    assert update is not None
    assert live.others == ()
    one = _only(compared)
    (f,) = one.functions
    (ports,) = stored_functions(live, one.configuration, compared.arrays)
    model = stored_model(live, one.configuration, compared.arrays)
    H, T = ports.values(model, model.at), compared.arrays[f.test_values_key]
    assert f.sd_key is not None
    sd = compared.arrays[f.sd_key]
    used = np.isfinite(sd)
    ratio = np.log(H[used] / T[used])
    shift: NDArray | float = 0.0 if f.shift_key is None else compared.arrays[f.shift_key][used]
    found = float(np.sum(((ratio.real + shift) ** 2 + ratio.imag**2) / sd[used] ** 2))
    (kind,) = update.goodness.by_kind if update.goodness is not None else ()
    assert kind.kind == "frf"
    assert found > 1.0
    assert found == pytest.approx(kind.chi_square, rel=1e-3)


def test_measured_functions_of_a_study_of_modes(bench: Bench) -> None:
    run = ft.run(bench.study(f"{_EI}\n[response]\nratio = 0.01\n", test="both.uff"), output=bench.folder / "modes")
    one = _only(run)
    (f,) = one.functions
    assert (f.label, f.sd_key, f.damping) == ("", None, "of the study")
    assert len(one.pairs) >= 3
    assert _apart(run, bench.folder, CANTILEVER) < 0.01
    page = html_text(build_report(run.results, run.arrays))
    assert "FRFs, %" in page
    assert '"look":"test","outputs":["3Y+","5Y+","5Z+"]' in page


def test_functions_without_damping_are_not_drawn_and_said_so(bench: Bench) -> None:
    run = ft.run(bench.study(_EI, test="both.uff"), output=bench.folder / "undamped")
    one = _only(run)
    assert one.functions == ()
    assert one.functions_reason == "neither the study nor the modes of the test have damping"
    page = html_text(build_report(run.results, run.arrays))
    assert "Measured FRFs are not computed again: neither the study nor the modes of the test have damping." in page


def test_the_measured_damping_of_the_modes_serves_where_nothing_is_stated(bench: Bench) -> None:
    truth = bench.measure(bench.folder / "truth" / "true.bdf")
    assert truth.modes is not None
    damped = replace(truth, modes=replace(truth.modes, damping_ratio=np.array([0.01, 0.02, 0.03, 0.04])))
    text = bench.uff(damped, "damped.uff").read_text() + (bench.folder / "frfs.uff").read_text()
    bench.write("damped_both.uff", text)
    run = ft.run(bench.study(_EI, test="damped_both.uff"), output=bench.folder / "measured_damping")
    one = _only(run)
    (f,) = one.functions
    known = {p.mode: (0.01, 0.02, 0.03, 0.04)[p.test] for p in one.pairs}
    assert {j: f.damping_ratios[j] for j in known} == pytest.approx(known)
    assert f.damping_ratios[-1] == pytest.approx(float(np.median(list(known.values()))))
    assert f.damping == "the measured damping of the paired modes, of others their median"


def test_dashpots_are_not_followed(bench: Bench) -> None:
    bench.write("dashpot.bdf", CANTILEVER.replace("ENDDATA", "CDAMP2,900,3.,5,2\nENDDATA"))
    run = ft.run(bench.study(_EI + _FRF, deck="dashpot.bdf", test="frfs.uff"), output=bench.folder / "dashpot")
    live = run.results.live
    assert live is not None
    assert _only(run).functions_reason == "the model has dashpots"
    assert [o.kind for o in live.others] == ["frf"]


@pytest.mark.parametrize(
    ("residual", "more"), [(_FRF, "[reduction]\n"), ("[response]\nratio = 0.01\n", "[output]\nlive = true\n")]
)
def test_functions_of_larger_models(bench: Bench, residual: str, more: str) -> None:
    text = fine(48)
    bench.write("fine.bdf", text)
    run = ft.run(
        bench.study(f"{_EI}\n{residual}{more}", deck="fine.bdf", test=_test_of(bench, text)),
        output=bench.folder / f"larger_{len(more)}_{len(residual)}",
    )
    (f,) = _only(run).functions
    assert f.bounds is not None
    worst = _apart(run, bench.folder, text, 4, **_SEEN)
    assert worst < 0.5
    assert worst < 3.0 * f.bounds.percent + 0.01


_SEEN: dict[str, Any] = {"inputs": ("49Y+", "49Z+"), "outputs": ("25Y+", "49Y+", "49Z+")}


def _test_of(bench: Bench, text: str) -> str:
    """Modes and functions of a beam of many bars."""
    deck = bench.write("truth/fine.bdf", with_factors(text, 1.3, 0.85))
    test = bench.measure(deck, *(f"{n}{d}+" for n in (13, 25, 37, 49) for d in "YZ"))
    ft.write_test(test, bench.folder / "fine_modes.uff")
    frfs = functions(deck, damping=_DAMPING, **_SEEN)
    write_uff_frfs(bench.folder / "fine_frfs.uff", ModalTest("frfs", SI, test.geometry, frfs=frfs))
    both = (bench.folder / "fine_modes.uff").read_text() + (bench.folder / "fine_frfs.uff").read_text()
    bench.write("fine.uff", both)
    return "fine.uff"


def test_functions_with_an_exponential_window_are_not_computed_again(bench: Bench) -> None:
    bench.write("windowed.toml", '[identify]\nfrfs = "frfs.uff"\nexponential_s = 0.5\n')
    run = ft.run(bench.study(_EI + _FRF, test="windowed.toml"), output=bench.folder / "windowed")
    assert _only(run).functions_reason == "they have an exponential window"
