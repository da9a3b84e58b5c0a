"""What a screening calculates from its runs: main effects of levels, elementary effects, or Sobol's indices.

A method has a name, the points of its runs in the unit cube, and the publications behind it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from femtune.experiments import (
    Design,
    elementary_effects,
    full_factorial,
    main_effects,
    morris_design,
    orthogonal_design,
    plackett_burman,
    sample,
    sobol_design,
    variance_indices,
)
from femtune.steps.screen.record import ElementaryEffect, MainEffect, SobolIndices
from femtune.study.record import alert
from femtune.surrogates import KrigingRules, fit_surrogate

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.files.study_file import ScreenTable
    from femtune.study.record import Alert

LITTLE = 0.01
"""Contribution to every mode below which a parameter is said to matter little: it may usually be fixed."""
MUCH = 0.1
"""Contribution from which a parameter is said to matter for a mode."""
_UNEXPLAINED = 0.05
"""Fraction of the variation above which an alert says that it is not explained.

It is smaller than contributions that matter.
"""
_CURVED = 0.5
"""Ratio σ/μ* of elementary effects above which an effect is said to depend on where it is taken.

By a nonlinearity or an interaction.
"""
_DEFAULT_LEVELS = 3
"""Levels of each parameter if the study gives none: two would not show a curvature."""
_DEFAULT_MORRIS_LEVELS = 4
"""Levels of elementary effects if the study gives none.

The usual number of the method, which visits all levels equally often.
"""
_DEFAULT_RUNS_PER_PARAMETER = 10
"""Runs per parameter for a fitted surrogate if the study gives none: the usual size of a computer experiment."""
_MOST_NAMED = 6
"""Modes that an alert lists, so that it stays one sentence."""
_FREQUENCY_ROUNDING = 1e-10
"""Relative variation of a frequency up to which it is rounding."""


@dataclass(frozen=True)
class ResponseLabels:
    """What the rows and columns of the responses are.

    Parameters
    ----------
    names : of the parameters
    modes : configuration and number of each mode
    others : names of the last of these, which are no modes but other values
    """

    names: tuple[str, ...]
    modes: tuple[tuple[str, int], ...]
    others: tuple[str, ...] = ()

    @property
    def word(self) -> str:
        """What they all are, for sentences."""
        return "value" if self.others else "frequency"

    @property
    def short(self) -> list[str]:
        """What each is called where there is no room for the configuration."""
        modes = self.modes[: len(self.modes) - len(self.others)]
        return [*(f"mode {mode}" for _, mode in modes), *self.others]

    def each(self) -> Iterator[tuple[int, int, dict[str, Any]]]:
        """Index of the parameter and of the mode, and what they are called in a record."""
        for i, name in enumerate(self.names):
            for j, (configuration, mode) in enumerate(self.modes):
                yield i, j, {"parameter": name, "configuration": configuration, "mode": mode}


@dataclass(frozen=True, eq=False)
class Findings:
    """What a method found.

    Parameters
    ----------
    unexplained : (m,) part of the variation of each frequency that it does not explain; None where it says nothing
    error_freedom : degrees of freedom of the error of main effects
    """

    sentences: tuple[str, ...]
    effects: tuple[MainEffect, ...] = ()
    elementary: tuple[ElementaryEffect, ...] = ()
    indices: tuple[SobolIndices, ...] = ()
    unexplained: Reals | None = None
    error_freedom: int | None = None
    alerts: tuple[Alert, ...] = ()


class ScreenMethod(Protocol):
    """See the module."""

    @property
    def name(self) -> str:
        """For messages and results."""

    @property
    def points(self) -> Reals:
        """(runs, n) points of the unit cube; a point may occur several times."""

    @property
    def papers(self) -> list[str]:
        """Keys of the publications."""

    def findings(self, values: Reals, places: ResponseLabels) -> Findings:
        """Of the frequencies (runs, m) of the runs in Hz; NaN where a run failed."""


def method_of_screen(table: ScreenTable, names: Sequence[str]) -> ScreenMethod:
    """The method that a table asks for, for these parameters (errors ``design.*``)."""
    parameters = len(names)
    if table.design == "morris":
        levels = table.levels if isinstance(table.levels, int) else _DEFAULT_MORRIS_LEVELS
        return _Morris(morris_design(parameters, table.trajectories, levels, table.seed))
    if table.design == "sobol":
        design = sobol_design(parameters, table.points, table.seed)
        if table.on == "model":
            return _Sobol(design, table.seed)
        return _SobolOfSurrogate(
            design,
            table.seed,
            sample(table.sample, parameters, table.runs or _DEFAULT_RUNS_PER_PARAMETER * parameters, table.seed),
        )
    if table.design == "plackett-burman":
        return _ByLevels(plackett_burman(parameters))
    counts = [table.levels if isinstance(table.levels, int) else _DEFAULT_LEVELS] * parameters
    if isinstance(table.levels, dict):
        counts = [table.levels.get(name, _DEFAULT_LEVELS) for name in names]
    if table.design == "factorial":
        return _ByLevels(full_factorial(counts))
    return _ByLevels(orthogonal_design(counts, table.array))


def method_of_table(values: Reals) -> ScreenMethod:
    """Main effects of finished runs (runs, n), by the values of each parameter that occur in them."""
    columns = [np.unique(column, return_inverse=True)[1] for column in values.T]
    edges = np.ptp(values, axis=0)
    points = (values - values.min(axis=0)) / np.where(edges > 0.0, edges, 1.0)
    return _ByLevels(Design("finished runs", points, np.stack(columns, axis=1)))


@dataclass(frozen=True, eq=False)
class _ByLevels:
    """Range analysis and analysis of variance of a design by levels."""

    design: Design

    @property
    def name(self) -> str:
        return self.design.name

    @property
    def points(self) -> Reals:
        return self.design.points

    @property
    def papers(self) -> list[str]:
        array, two = self.name.startswith("L"), "Burman" in self.name
        return ["montgomery2017", *(["hedayat1999"] if array else []), *(["plackett1946"] if two else [])]

    def findings(self, values: Reals, places: ResponseLabels) -> Findings:
        assert self.design.levels is not None
        good = np.isfinite(values).all(axis=1)
        effects = main_effects(self.design.levels[good], values[good])
        alerts = _unexplained("screen.interactions", effects.error_contribution, places)
        if effects.error_freedom == 0:
            alerts = (*alerts, alert("info", "screen.saturated", runs=len(values)))
        left = 100.0 * (1.0 - effects.error_contribution.max())
        return Findings(
            (
                *_sorted(effects.contribution, places, "of the variation"),
                f"Main effects explain at least {left:.1f} % of the variation of each {places.word}.",
            ),
            effects=tuple(
                MainEffect(
                    **place,
                    contribution=float(effects.contribution[i, j]),
                    f_value=_finite(effects.f_values[i, j]),
                    p_value=_finite(effects.p_values[i, j]),
                    range_hz=float(effects.ranges[i, j]),
                    means_hz=tuple(effects.level_means[i][:, j].tolist()),
                )
                for i, j, place in places.each()
            ),
            unexplained=effects.error_contribution,
            error_freedom=effects.error_freedom,
            alerts=alerts,
        )


@dataclass(frozen=True, eq=False)
class _Morris:
    """Elementary effects along trajectories (r, n + 1, n)."""

    paths: Reals

    @property
    def name(self) -> str:
        return f"Morris, {len(self.paths)} trajectories"

    @property
    def points(self) -> Reals:
        return self.paths.reshape(-1, self.paths.shape[2])

    @property
    def papers(self) -> list[str]:
        return ["morris1991", "campolongo2007"]

    def findings(self, values: Reals, places: ResponseLabels) -> Findings:
        effects = elementary_effects(self.paths, values.reshape(*self.paths.shape[:2], -1))
        largest = effects.absolute.max(axis=0)
        share = effects.absolute / np.where(largest > 0.0, largest, np.inf)
        varies = (share >= MUCH) & (effects.spread > _CURVED * effects.absolute)
        curved = [name for name, row in zip(places.names, varies) if row.any()]
        told = [f"Effects that depend on the values of the parameters (σ above {_CURVED:g} μ*): {_named(curved)}."]
        return Findings(
            (*_sorted(share, places, "of the largest effect μ*"), *(told if curved else [])),
            elementary=tuple(
                ElementaryEffect(
                    **place,
                    mean_hz=float(effects.mean[i, j]),
                    absolute_hz=float(effects.absolute[i, j]),
                    absolute_margin_hz=_finite(effects.margin[i, j]),
                    spread_hz=_finite(effects.spread[i, j]),
                )
                for i, j, place in places.each()
            ),
        )


@dataclass(frozen=True, eq=False)
class _Sobol:
    """Sobol's indices by runs of the model at all points of the design (n + 2, points, n)."""

    design: Reals
    seed: int

    @property
    def name(self) -> str:
        return f"Sobol's indices by {self.design.shape[1]} points"

    @property
    def points(self) -> Reals:
        return self.design.reshape(-1, self.design.shape[2])

    @property
    def papers(self) -> list[str]:
        return ["sobol2001", "saltelli2010"]

    def findings(self, values: Reals, places: ResponseLabels) -> Findings:
        effects = variance_indices(values.reshape(*self.design.shape[:2], -1), self.seed)
        assert effects.first_interval is not None
        assert effects.total_interval is not None
        varying = effects.total.sum(axis=0) > 0.0
        alone = min(100.0 * float(effects.first.sum(axis=0)[varying].min(initial=1.0)), 100.0)
        return Findings(
            (
                *_sorted(effects.total, places, "of the variance, with interactions,"),
                f"Single parameters explain at least {alone:.1f} % of the variance of each frequency; the rest is "
                "interactions.",
            ),
            indices=tuple(
                SobolIndices(
                    **place,
                    first=float(effects.first[i, j]),
                    first_interval=(float(effects.first_interval[0, i, j]), float(effects.first_interval[1, i, j])),
                    total=float(effects.total[i, j]),
                    total_interval=(float(effects.total_interval[0, i, j]), float(effects.total_interval[1, i, j])),
                )
                for i, j, place in places.each()
            ),
        )


@dataclass(frozen=True, eq=False)
class _SobolOfSurrogate:
    """Sobol's indices of Kriging of runs at the points of a Latin hypercube."""

    design: Reals
    seed: int
    runs: Design

    @property
    def name(self) -> str:
        return f"{_Sobol(self.design, self.seed).name} of Kriging"

    @property
    def points(self) -> Reals:
        return self.runs.points

    @property
    def papers(self) -> list[str]:
        return [*_Sobol(self.design, self.seed).papers, "sacks1989"]

    def findings(self, values: Reals, places: ResponseLabels) -> Findings:
        good = np.isfinite(values).all(axis=1)
        x, y = self.points[good], values[good]
        edges = np.zeros(x.shape[1]), np.ones(x.shape[1])
        fitted = fit_surrogate(x, y, KrigingRules("linear", seed=self.seed), edges, places.names)
        on = _Sobol(self.design, self.seed)
        effects = on.findings(fitted.predict(on.points), places)
        error, spread = np.mean((fitted.left_out - y) ** 2, axis=0), np.var(y, axis=0)
        varies = spread > (_FREQUENCY_ROUNDING * y.mean(axis=0)) ** 2
        unexplained = np.where(varies, error / np.where(varies, spread, 1.0), 0.0)
        left = 100.0 * (1.0 - unexplained.max())
        return Findings(
            (*effects.sentences, f"Kriging predicts at least {left:.1f} % of the variance of each frequency in runs "
             "that are left out."),
            indices=effects.indices,
            unexplained=unexplained,
            alerts=_unexplained("screen.surrogate-error", unexplained, places),
        )  # fmt: skip


def _unexplained(code: str, parts: Reals, places: ResponseLabels) -> tuple[Alert, ...]:
    mixed = [f"{name} ({100 * part:.0f} %)" for name, part in zip(places.short, parts) if part > _UNEXPLAINED]
    return (alert("info", code, modes=", ".join(mixed[:_MOST_NAMED])),) if mixed else ()


def _sorted(share: Reals, places: ResponseLabels, of: str) -> list[str]:
    """Sentences that name the parameters by their largest share (n, m) in any frequency."""
    largest = share.max(axis=1)
    order = np.argsort(-largest, kind="stable")
    much = [places.names[i] for i in order if largest[i] >= MUCH]
    little = [places.names[i] for i in order if largest[i] < LITTLE]
    between = [places.names[i] for i in order if LITTLE <= largest[i] < MUCH]
    out = [f"More than {100 * MUCH:.0f} % {of} of at least one {places.word}: {_named(much)}."]
    if between:
        out.append(f"Between {100 * LITTLE:.0f} and {100 * MUCH:.0f} %: {_named(between)}.")
    if little:
        out.append(f"Less than {100 * LITTLE:.0f} % {of} of every {places.word}: {_named(little)}.")
    return out


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _named(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"
