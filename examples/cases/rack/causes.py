"""What decides over the predicted RMS of random vibration: the moduli, the mesh, and what the modal test leaves open.

All of this looks at the result after the verdicts. Nothing of it goes back into the updates.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from geometry import NOMINAL
from laboratory import SPECTRUM, SPECTRUM_HZ
from matrices import MODULI, Fit, Matrices

import femtune as ft
from femtune.modal import ModeSet
from femtune.model import solve_modes
from femtune.model.damping import damping_table
from femtune.model.response.ports import make_ports
from femtune.model.vibration import (
    ModalTransfer,
    Spectrum,
    base_transfer,
    response_density,
    response_rms,
    transfer_of_base,
)
from femtune.study.study import load_study

HANDBOOK = {"E1": 0.03, "E2": 0.02}
"""Relative standard deviations of the moduli of aluminium tubes and of steel about the drawings, as handbooks have
them."""
FINER, ON_TABLE, MIXED_ON_TABLE = 2, 150, 230
"""Parts of each cell of the finer mesh; modes on the table, to about 3 kHz."""
DRAWS, CANDIDATES = 24, 1_000_000
RESULT = "result of the update"
RITZ_ERROR = 0.02
"""Relative, of an RMS value by Ritz's method beside a full solution."""
LOOKED_AT = np.arange(40.0, 1000.0, 0.05)
"""Where the largest resonance is looked for; below is the first one of the rack on its table."""
SPECTRA = [Spectrum(np.array(SPECTRUM_HZ), np.array(SPECTRUM))]


@dataclass(frozen=True, eq=False)
class Variant:
    """The solid model with other moduli or another mesh.

    Parameters
    ----------
    fit : moduli, χ² of the six frequencies, MAC of all test modes
    rms, peak_hz : (o,) by output
    """

    name: str
    fit: Fit
    rms: np.ndarray
    peak_hz: np.ndarray

    @property
    def updated(self) -> bool:
        """Whether all its moduli are those of an update."""
        return "E4 of" not in self.name


@dataclass(frozen=True, eq=False)
class Causes:
    """Variants of the solid model, and RMS values (draws, o) by model where the moduli are drawn."""

    variants: tuple[Variant, ...]
    drawn: dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Table:
    """The test on the table: its damping, and its outputs."""

    damping_ratio: np.ndarray
    damping_hz: np.ndarray
    outputs: tuple[str, ...]


def causes(
    program: str,
    folder: Path,
    table: Table,
    updated: tuple[dict[str, float], dict[str, float]],
    frequencies: tuple[float, int],
    bounds: dict[str, tuple[float, float]],
) -> Causes:
    """Solutions of variants, and draws; `updated` has the values of the mixed and the solid model.

    `frequencies` are the standard deviation and the number of those that are compared.
    """
    test, (mixed, solid), (sd, used) = _tested(folder), updated, frequencies
    meshes = {n: Matrices(program, folder / "matrices" / str(n), n) for n in (1, FINER)}
    damping = damping_table(table.damping_hz, table.damping_ratio, flat=True)

    def transfer(matrices: Matrices, values: dict[str, float]) -> ModalTransfer:
        return transfer_of_base(matrices.on_table(values, table.outputs, ON_TABLE), damping, table.outputs)

    def at(values: dict[str, float]) -> Fit:
        hz, mac, slopes = meshes[1].compared(values, test)
        residuals = np.log(hz[:used] / test.freq_hz[:used]) / sd
        return Fit(values, float(residuals @ residuals), mac, residuals, slopes[:used] / sd)

    def fitted(divided: int, known: dict[str, float]) -> Fit:
        return meshes[divided].updated(solid, test, sd, used, bounds, known)

    of_test = at(solid)
    ways = [
        (RESULT, 1, of_test),
        ("E4 of the mixed model", 1, at({**solid, "E4": mixed["E4"]})),
        ("handbook", 1, fitted(1, HANDBOOK)),
        ("finer mesh", FINER, fitted(FINER, {})),
        ("finer mesh, handbook", FINER, fitted(FINER, HANDBOOK)),
    ]
    variants = []
    for name, divided, fit in ways:
        found = transfer(meshes[divided], fit.values)
        peaks = LOOKED_AT[response_density(found, SPECTRA, LOOKED_AT).argmax(axis=1)]
        variants.append(Variant(name, fit, response_rms(found, SPECTRA), peaks))
    values = drawn(
        np.array([solid[name] for name in MODULI]), of_test.residuals,
        lambda x: np.log(x / [solid[name] for name in MODULI]) @ of_test.relative.T,
        np.array([bounds[name] for name in MODULI]).T,
    )  # fmt: skip
    # shapes at moduli to all sides of the draws make Ritz's method accurate
    for v in values[:2]:
        meshes[1].on_table(_with(solid, v), table.outputs, ON_TABLE)
    fast = meshes[1].reduced(table.outputs, ON_TABLE)
    of_solid = [response_rms(transfer_of_base(fast(_with(solid, v)), damping, table.outputs), SPECTRA) for v in values]
    exact = response_rms(transfer(meshes[1], _with(solid, values[2])), SPECTRA)
    assert np.abs(of_solid[2] / exact - 1.0).max() < RITZ_ERROR, (of_solid[2], exact)
    return Causes(tuple(variants), {"mixed": _of_mixed(folder, table, mixed), "solid": np.array(of_solid)})


def _with(values: dict[str, float], moduli: np.ndarray) -> dict[str, float]:
    return {**values, **dict(zip(MODULI, moduli.tolist(), strict=True))}


def _tested(folder: Path) -> ModeSet:
    modes = ft.read_test(folder / "rack.uff").modes
    assert modes is not None
    return modes


def drawn(
    at: np.ndarray,
    residuals: np.ndarray,
    change: Callable[[np.ndarray], np.ndarray],
    limits: np.ndarray,
) -> np.ndarray:
    """(DRAWS, p) values that the data allow, all values in the bounds being equally probable beforehand.

    Parameters
    ----------
    at, residuals : the point (p,) and the residuals (n,) there
    change : of the residuals (c, n) at points (c, p), linear around this point
    limits : (2, p)
    """
    chance = np.random.default_rng(5)
    points = chance.uniform(*limits, size=(CANDIDATES, len(at)))
    chi_square = ((residuals + change(points)) ** 2).sum(axis=1)
    weights = np.exp(-0.5 * (chi_square - chi_square.min()))
    assert weights.sum() ** 2 / (weights**2).sum() > 10 * DRAWS, "too few candidates near the data"
    return points[chance.choice(CANDIDATES, DRAWS, replace=False, p=weights / weights.sum())]


def _of_mixed(folder: Path, table: Table, values: dict[str, float]) -> np.ndarray:
    study = load_study(folder / "study.toml")
    parameters, problem = study.parameters, study.problem()
    start = problem.start(parameters.normalise(values[p.name] for p in parameters.free))
    points = drawn(start.x, start.residuals, lambda x: (x - start.x) @ start.jacobian.T, np.array(parameters.bounds))
    case = next(c for c in study.cases if c.name == "table")
    damping = damping_table(table.damping_hz, table.damping_ratio, flat=True)
    found = []
    for x in points:
        modes = solve_modes(case.configured.at(x), MIXED_ON_TABLE)
        ports = make_ports(case.configured, [table.outputs[0]], table.outputs)
        found.append(response_rms(base_transfer(modes, ports, "X", damping), SPECTRA))
    return np.array(found)


def ends(some: Sequence[str] | np.ndarray) -> tuple[str | float, str | float]:
    """The first and the last."""
    return some[0], some[-1]


def lines(found: Causes, measured: np.ndarray, outputs: Sequence[str], limit: float) -> list[str]:
    """The section of the page; `measured` (o,) are the RMS values of the test."""
    heads = [*(f"{name}, GPa" for name in MODULI), "χ²", "lowest MAC, 8 modes"]
    heads += [*(f"error at {name} %" for name in outputs), *(f"largest at {n}, Hz" for n in ends(outputs))]
    text = [f"| solid model | {' | '.join(heads)} |", "| --- " * (len(heads) + 1) + "|"]
    for v in found.variants:
        moduli = [f"{v.fit.values[name] / 1e9:.1f}" for name in MODULI]
        if v.updated:
            moduli[-1] += f" ± {v.fit.sd['E4'] / 1e9:.0f}"
        cells = [*moduli, f"{v.fit.chi_square:.2f}"]
        cells += [f"{v.fit.mac.min():.3f}", *(f"{100.0 * e:+.1f}" for e in v.rms / measured - 1.0)]
        text.append(f"| {v.name} | {' | '.join([*cells, *(f'{hz:.0f}' for hz in ends(v.peak_hz))])} |")
    text += ["", f"RMS values of {DRAWS} draws of the parameters from what the modal test allows within the bounds, "
             "all else being equal (all values in the bounds equally probable beforehand, residuals linear around the "
             "result), as errors in %: median, and the range of the middle 90 %.", "",
             "| model | " + " | ".join(outputs) + f" | draws within {100.0 * limit:.0f} % at all points |",
             "| --- " * (len(outputs) + 2) + "|"]  # fmt: skip
    for name, rms in found.drawn.items():
        errors = 100.0 * (rms / measured - 1.0)
        low, middle, high = np.quantile(errors, [0.05, 0.5, 0.95], axis=0)
        cells = [f"{m:+.0f} ({a:+.0f} to {b:+.0f})" for a, m, b in zip(low, middle, high, strict=True)]
        text.append(f"| {name} | {' | '.join(cells)} | {_kept(rms, measured, limit)} |")
    return [*text, ""]


def _kept(rms: np.ndarray, measured: np.ndarray, limit: float) -> str:
    kept = int((np.abs(rms / measured - 1.0) <= limit).all(axis=1).sum())
    return f"{kept} of {len(rms)}"


def conclusions(
    found: Causes,
    measured: np.ndarray,
    outputs: Sequence[str],
    test_hz: np.ndarray,
    limit: float,
    mixed: str,
    above: str,
) -> list[str]:
    """What the table of variants says; `test_hz` (o,) are the largest resonances of the test.

    `mixed` is E4 of the mixed model, `above` what lies above the modal test, both in words.
    """
    by_name = {v.name: v for v in found.variants}
    result, swapped, handbook, finer, both = (
        by_name[name] for name in (RESULT, "E4 of the mixed model", "handbook", "finer mesh", "finer mesh, handbook")
    )

    def e4(v: Variant) -> str:
        return f"{v.fit.values['E4'] / 1e9:.0f} ± {v.fit.sd['E4'] / 1e9:.0f} GPa"

    def hertz(i: int, *some: Variant) -> str:
        return ", ".join(f"{v.peak_hz[i]:.0f} Hz ({v.name})" for v in some)

    first, last = 0, len(outputs) - 1
    kept = [v.name for v in found.variants if (np.abs(v.rms / measured - 1.0) <= limit).all()]
    worst = {v.name: 100.0 * np.abs(v.rms / measured - 1.0).max() for v in found.variants}
    none = f"None of the five keeps {100.0 * limit:.0f} % at all points"
    within = " and ".join(f"{_kept(rms, measured, limit)} ({name})" for name, rms in found.drawn.items())
    keeps = f"The limit is kept at all points by: {', '.join(kept)}" if kept else none
    return [
        f"- **E4 is not determined** by the six frequencies of the free rack in the solid model: {e4(result)} without "
        f"the bounds, {e4(finer)} with the finer mesh. With the moduli of tubes and blocks from the handbook it is "
        f"{e4(handbook)}, and {e4(both)} with the finer mesh; in the mixed model {mixed}, within the bounds. χ² goes "
        f"from {result.fit.chi_square:.2f} to {handbook.fit.chi_square:.2f}, and the lowest MAC of the eight test "
        f"modes, two of which are in no update, from {result.fit.mac.min():.3f} to {handbook.fit.mac.min():.3f}.",
        f"- The largest resonance at {outputs[last]} ({test_hz[last]:.0f} Hz in the test) moves with E4: "
        f"{hertz(last, result, swapped, handbook, finer, both)}.",
        f"- The largest resonance at {outputs[first]} ({test_hz[first]:.0f} Hz in the test) moves with E4 and the "
        f"mesh: {hertz(first, result, swapped, finer, both)}.",
        f"- {keeps}; the largest error is "
        + ", ".join(f"{value:.0f} % ({name})" for name, value in worst.items())
        + f". {above}",
        f"- The verdict of a model holds at its result. Of the values that the modal test allows, {within} keep the "
        "limit at all points: a prediction to 2000 Hz takes more data than six modes below 150 Hz.",
        "",
    ]


def handbook_words() -> str:
    """The prior knowledge in words."""
    return ", ".join(f"{name} {NOMINAL[name] / 1e9:.0f} GPa ± {100 * sd:.0f} %" for name, sd in HANDBOOK.items())
