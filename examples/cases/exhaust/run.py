"""Update an exhaust system bottom-up: python run.py [--quick] [--evidence DIR].

Similar to the exhaust system of the handbook chapter (section 9): a front part, a rear part with a muffler, and a
clamp. Each part is tested separately, then the assembly. All tests are simulated with noise, so that all true values
are known. Masses are updated first, then stiffnesses, then damping in the resonance regions, and finally the joint.
The full form has several samples of noise.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np

import femtune as ft
from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import BLUE, INK, LINE, ORANGE, PALE
from femtune.document.numbers import short
from femtune.model import solve_modes
from femtune.model.response import frf, make_ports
from femtune.steps.run.result import RunResult
from femtune.steps.update.record.stages import StageResults
from femtune.steps.update.record.update import UpdateResults
from femtune.study.cases import StudyCase
from femtune.study.study import load_study
from structures.exhaust import (
    FRONT,
    KNOWN,
    REAR,
    WHOLE,
    Exhaust,
    Known,
    Measured,
    Noise,
    exhaust_deck,
    simulated_tests,
    write_tests,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NOISE = Noise()
RANGES = {"mass": (0.3, 3.0), "stiffness": (0.5, 2.0), "joint": (0.2, 5.0), "damping": (0.01, 20.0)}
LOCAL_HZ = 380.0
"""Above it the modes of the rear part are those of the muffler's end plates."""


@dataclass(frozen=True)
class Size:
    """How much is computed.

    Parameters
    ----------
    noise_seeds : of the noise of the tests
    step_hz : between the lines
    starts : further initial values of dampings over those of the deck
    started : configurations whose damping stages have these starts
    """

    noise_seeds: tuple[int, ...]
    step_hz: float
    starts: tuple[float, ...]
    started: tuple[str, ...]


QUICK = Size((1,), 0.5, (3.0,), ())
FULL = Size((1, 2, 3, 4, 5), 0.25, (0.3, 3.0), (FRONT, REAR, WHOLE))

STAGES = (
    ("front, mass", FRONT, ("m_converter",), ("mass",)),
    ("front, stiffness", FRONT, ("E_front", "E_converter"), ("frequency", "shape")),
    ("front, damping", FRONT, ("eta_front", "eta_converter"), ("resonances",)),
    ("rear, mass", REAR, ("m_wool",), ("mass",)),
    ("rear, stiffness", REAR, ("E_rear", "E_muffler"), ("frequency", "shape")),
    ("rear, damping", REAR, ("eta_rear", "eta_muffler"), ("resonances",)),
    ("joint, stiffness", WHOLE, ("k_bend", "k_twist"), ("frequency", "shape")),
    ("joint, damping", WHOLE, ("b_bend", "b_twist"), ("resonances",)),
)


def study(tests: Sequence[Measured], files: dict[str, str], size: Size) -> str:
    """The study file."""
    head = (
        '[study]\ntitle = "Exhaust system, bottom-up"\ndeck = "exhaust.bdf"\nunits = "m-kg-s"\n\n'
        "[modes]\ncount = 26\n\n"
        f'[residuals]\nfrequency_sd = {NOISE.frequency!r}\nshape_sd = {NOISE.shape!r}\nshape_sd_of = "scaled-shape"\n\n'
        "[update]\nmax_iterations = 30\ntolerance = 1e-6\n\n[sensors]\nby_id = true\n"
    )
    blocks = [head, *(_configuration(one, files[one.name]) for one in tests), *map(_parameter, KNOWN)]
    blocks += [
        f'[[residual]]\nkind = "mass"\nconfiguration = "{one.name}"\nmass = {one.weighed!r}\nsd = {NOISE.mass!r}\n'
        for one in tests[:2]
    ]
    return "\n".join([*blocks, *(_stage(*one, size) for one in STAGES)])


def _configuration(one: Measured, file: str) -> str:
    lines = ["[[configuration]]", f'name = "{one.name}"', f'test = "{file}"', f"weighed_mass = {one.weighed!r}"]
    if one.elements_off:
        lines.append(f"elements_off = {list(one.elements_off)}")
    local = [i for i, f in enumerate(one.test.modes.freq_hz) if one.name == REAR and f > LOCAL_HZ]
    reason = "local mode of the muffler, which its sensors cannot distinguish"
    entries = ", ".join(f'{{ mode = "{one.test.modes.labels[i]}", reason = "{reason}" }}' for i in local)
    return "\n".join([*lines, *([f"leave_out = [{entries}]"] if local else []), ""])


def _parameter(known: Known) -> str:
    low, high = RANGES[known.kind.removeprefix("joint ")]
    return (
        f'[[parameter]]\nname = "{known.name}"\nfields = {list(known.fields)!r}\n'
        f'absolute = true\nunit = "{known.unit}"\n'
        f"lower = {known.nominal * low!r}\nupper = {known.nominal * high!r}\n"
    )


def _stage(name: str, configuration: str, parameters: tuple[str, ...], kinds: tuple[str, ...], size: Size) -> str:
    lines = [
        "[[stage]]", f'name = "{name}"', f'configurations = ["{configuration}"]', f"parameters = {list(parameters)!r}",
        f"residuals = {list(kinds)!r}",
    ]  # fmt: skip
    if "resonances" in kinds:
        lines += [f"frf_sd = {NOISE.frf!r}", f"frf_floor = {NOISE.floor!r}"]
    if "resonances" in kinds and configuration in size.started:
        nominal = {k.name: k.nominal for k in KNOWN}
        seeds = [", ".join(f"{p} = {s * nominal[p]!r}" for p in parameters) for s in size.starts]
        lines.append("seeds = [" + ", ".join(f"{{ {seed} }}" for seed in seeds) + "]")
    return "\n".join([*lines, ""]).replace("'", '"')


@dataclass(frozen=True)
class Curves:
    """One measured accelerance of a state, and the updated model's with the deck's dampings and with those found."""

    name: str
    freq_hz: np.ndarray
    measured: np.ndarray
    before: np.ndarray
    after: np.ndarray


@dataclass(frozen=True)
class Found:
    """One run of the study."""

    seed: int
    run: RunResult
    curves: tuple[Curves, ...]

    @property
    def update(self) -> UpdateResults:
        """The update of the run."""
        assert self.run.results.update is not None
        return self.run.results.update

    @property
    def errors(self) -> dict[str, float]:
        """(updated − true)/σ by parameter."""
        found = {p.name: p for p in self.update.parameters}
        return {k.name: (found[k.name].value - k.truth) / (found[k.name].sd or np.nan) for k in KNOWN}


def solve(exhaust: Exhaust, size: Size, seed: int, folder: Path) -> Found:
    """Test the true structure, write the study, run it."""
    folder.mkdir(parents=True, exist_ok=True)
    deck = folder / "exhaust.bdf"
    deck.write_text(exhaust.text, encoding="ascii")
    tests = simulated_tests(exhaust, deck, seed, NOISE, size.step_hz)
    (folder / "study.toml").write_text(study(tests, write_tests(tests, folder), size), encoding="utf-8")
    run = ft.update(folder / "study.toml")
    cases = {case.name: case for case in load_study(folder / "study.toml").cases}
    found = Found(seed, run, tuple(curves(cases[one.name], run, one) for one in tests[1:]))
    check(found)
    return found


def curves(case: StudyCase, run: RunResult, one: Measured) -> Curves:
    """The last output over the first input, as in the chapter's Figure 30."""
    measured, parameters = one.test.frfs, case.configured.model.parameters
    assert measured is not None
    assert run.results.update is not None
    after = {p.name: p.value for p in run.results.update.parameters}
    before = after | {k.name: k.nominal for k in KNOWN if k.kind.endswith("damping")}
    ports = make_ports(case.configured, [measured.references[0]], [measured.responses[len(measured.responses) - 1]])
    found = []
    for values in (before, after):
        x = parameters.normalise(values[p.name] for p in parameters.free)
        found.append(frf(solve_modes(case.configured.at(x), 40), ports, measured.freq_hz).values[0, 0])
    return Curves(one.name, measured.freq_hz, measured.values[-1, 0], *found)


def check(found: Found) -> None:
    """What the study must reach."""
    for stage in found.update.stages:
        assert stage.ok, stage
        assert all(run.agrees for run in stage.runs), stage.runs
    for c in found.run.results.correlations:
        if c.stage == "after":
            assert c.pairs, c.configuration
            assert max(abs(p.freq_error_percent) for p in c.pairs) < 3.0, c.configuration
            assert min(p.mac for p in c.pairs if p.mac is not None) > 0.9, c.configuration
    # chance exceeds this in one of 16,000 values
    assert max(map(abs, found.errors.values())) < 4.0, found.errors


def check_all(runs: Sequence[Found]) -> None:
    """Nine values of ten lie within two standard deviations, and all but one within three.

    Of 70 values of a right model one or more are beyond three with a probability of 17 %, two or more of 2 %.
    """
    errors = np.abs([list(found.errors.values()) for found in runs])
    assert np.mean(errors < 2.0) >= 0.9, errors
    assert np.sum(errors > 3.0) <= 1, errors


def text(runs: Sequence[Found], size: Size) -> str:
    """The page."""
    first = runs[0]
    return "\n".join([
        "# Bottom-up updating of an exhaust system", "",
        "Similar to section 9 of the handbook chapter: a front part with a converter, a rear part with a muffler "
        "and a clamp between them, modelled by our own deck (beams and shells, 2262 DOFs). The tests of each part "
        f"and of the whole system are simulated: modes (standard deviations of frequencies {NOISE.frequency:g}, of "
        f"shapes {NOISE.shape:g} of unit norm), accelerances ({100 * NOISE.frf:g} % of each value in real and "
        f"imaginary part), measured masses ({100 * NOISE.mass:g} %). The study has {len(STAGES)} stages; the result "
        "of each is the prior of the next, and the uncertainty of fixed parameters is included.",
        "",
        *_values(first), "", f"Of {len(runs)} seeds of noise, {_shares(runs)}", "",
        *_stages(first.update.stages), "",
        "![Error sums of the damping stages, deviations from the true values, and accelerances](cases_exhaust.svg)", "",
        *_modes(first), "",
    ])  # fmt: skip


def _values(found: Found) -> list[str]:
    results = {p.name: p for p in found.update.parameters}
    rows = [
        f"| {k.name} | {', '.join(k.fields)} | {k.nominal:.5g} | {k.truth:.5g} | {results[k.name].value:.5g} | "
        f"{results[k.name].sd:.2g} | {found.errors[k.name]:+.2f} |"
        for k in KNOWN
    ]
    head = "| parameter | fields | deck | true value | updated | σ | (updated − true)/σ |"
    return [head, "| --- | --- | --- | --- | --- | --- | --- |", *rows]


def _shares(runs: Sequence[Found]) -> str:
    errors = np.abs([list(found.errors.values()) for found in runs])
    return (
        f"{100 * np.mean(errors < 2.0):.0f} % of the {errors.size} values are within 2 σ of the true value "
        f"(required: 90 %), and the largest deviation is {errors.max():.2f} σ (required: one value beyond "
        "3 at most, none beyond 4)."
    )


def _stages(stages: Sequence[StageResults]) -> list[str]:
    rows = []
    for s in stages:
        before, after = (sum(getattr(e, name) for e in s.error_sums) for name in ("before", "after"))
        agree = f"{sum(r.agrees for r in s.runs)} of {len(s.runs)}"
        sizes = ", ".join(f"{m.kind} {m.size:.2f}" for m in s.misfit)
        rows.append(f"| {s.name} | {s.comparisons} | {before:.4g} | {after:.4g} | {sizes} | {agree} |")
    head = "| stage | values | error sum before | after | misfit | starts that agree |"
    return [head, "| --- | --- | --- | --- | --- | --- |", *rows]


def _modes(found: Found) -> list[str]:
    rows = []
    for c in found.run.results.correlations:
        if c.stage in ("before", "after") and c.pairs:
            worst = max(abs(p.freq_error_percent) for p in c.pairs)
            mac = min(p.mac for p in c.pairs if p.mac is not None)
            rows.append(f"| {c.configuration} | {c.stage} | {len(c.pairs)} | {worst:.3g} | {mac:.4f} |")
    head = "| configuration | | pairs | largest frequency error % | lowest MAC |"
    return [head, "| --- | --- | --- | --- | --- |", *rows]


def figure(runs: Sequence[Found]) -> str:
    """Error sums of the damping stages as in the chapter's Figure 29, and all deviations from the truth."""
    damping = [s for s in runs[0].update.stages if s.name.endswith("damping")]

    def draw(sheet: Figure) -> None:
        axes = sheet.subplots(3, 2).ravel()
        for panel, stage in zip(axes, damping):
            _bars(panel, stage)
        _deviations(axes[3], runs)
        for panel, one in zip(axes[4:], runs[0].curves):
            _curves(panel, one)

    return draw_svg(9.2, 8.2, draw)


def _bars(axes: Axes, stage: StageResults) -> None:
    before, after = ([getattr(e, name) for e in stage.error_sums] for name in ("before", "after"))
    total, at = sum(before), np.arange(len(before) + 1)
    axes.bar(at - 0.2, 100 / total * np.array([*before, total]), 0.38, color=PALE, label="before")
    axes.bar(at + 0.2, 100 / total * np.array([*after, sum(after)]), 0.38, color=BLUE, label="after")
    axes.set_xticks(at, [*(e.label for e in stage.error_sums), "all"])
    axes.set_title(f"{stage.name}: error sums by mode, %")
    axes.legend(frameon=False, fontsize=7)


def _curves(axes: Axes, one: Curves) -> None:
    axes.semilogy(one.freq_hz, np.abs(one.measured), color=PALE, linewidth=2.4, label="test")
    axes.semilogy(one.freq_hz, np.abs(one.before), color=ORANGE, linewidth=0.8, label="dampings of the deck")
    axes.semilogy(one.freq_hz, np.abs(one.after), color=BLUE, linewidth=0.9, label="updated")
    axes.set_xlim(0.0, LOCAL_HZ if one.name == REAR else one.freq_hz[-1])
    axes.set_xlabel("Hz")
    axes.yaxis.set_major_formatter(lambda y, _: short(y))
    axes.yaxis.set_minor_formatter("")
    axes.set_title(f"{one.name}: an accelerance, 1/kg")
    axes.legend(frameon=False, fontsize=7, loc="upper right")


def _deviations(axes: Axes, runs: Sequence[Found]) -> None:
    names = [k.name for k in KNOWN]
    axes.axhspan(-2, 2, color=LINE, zorder=0)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    for found in runs:
        axes.plot(names, list(found.errors.values()), "o", color=ORANGE, markersize=3.5, alpha=0.8)
    axes.set_ylim(-3.2, 3.2)
    axes.tick_params(axis="x", rotation=70)
    axes.set_title("(updated − true)/σ, all seeds of noise")


def main() -> None:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one seed of noise, and no further starts")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    parser.add_argument("--folder", type=Path, help="keep study and run there")
    options = parser.parse_args()
    size = QUICK if options.quick else FULL
    with tempfile.TemporaryDirectory() as temporary:
        root = options.folder or Path(temporary)
        runs = [solve(exhaust_deck(), size, seed, root / f"seed_{seed}") for seed in size.noise_seeds]
    check_all(runs)
    page = text(runs, size)
    print(page)
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "cases_exhaust.md").write_text(page, encoding="utf-8")
        (options.evidence / "cases_exhaust.svg").write_text(figure(runs), encoding="utf-8")


if __name__ == "__main__":
    main()
