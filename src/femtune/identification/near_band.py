"""Modes just outside the band, which bend the functions inside it: fitted with the others, and not reported.

The real terms for what lies outside are right far from the band only. Beside modes that are near, they leave a
systematic error, which moves poles and residues by more than their standard deviations. One mode cannot stand for
several, so further ones are added while these explain more than chance.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import chdtri

from femtune.arrays import Complexes, Flags, Reals
from femtune.identification.join import at_lines
from femtune.identification.modal_fit import NO_POLES, ModalFit, deviance_at, fit_modes
from femtune.identification.modal_solve import OutsideTerms
from femtune.identification.whole_record import WholeRecord
from femtune.modal import FrfSet, freq_and_damping, pole_of

GAPS = (0.003, 0.01, 0.03, 0.1, 0.25)
"""Relative distances from the band at which a mode is looked for first."""
CHANCE = 1e-4
"""A mode outside the band is taken where noise lowers the errors as much with a smaller probability."""
MOST = 3
"""Modes on one side of the band."""
_LEAST_DAMPING = 1e-3
"""Damping ratio of a trial pole beyond the band at least, where the poles of the band have next to none."""
_MOST_DAMPING = 0.9
"""Damping ratio of a trial pole at most."""
APART = 0.1
"""Distance of two neighbours in half bandwidths below which they are one."""
ENOUGH_LINES = 3000
"""Lines of a whole record by which places beyond the band are compared."""
_ENOUGH_VALUES = 20_000
"""Values with weights of their own by which they are compared: the cost is proportional to their number."""
_FARTHEST = 2.0
"""Factor on the ends of the band within which a pole beyond it is accepted; others act as a static or mass line."""


def fit_with_neighbours(
    frfs: FrfSet,
    start: Complexes,
    sd: Reals | None,
    terms: OutsideTerms,
    whole: WholeRecord | None = None,
    known: Complexes = NO_POLES,
) -> ModalFit:
    """The modal fit, with up to `MOST` further modes below the band and above it, where each explains more than chance.

    Parameters
    ----------
    frfs, start, sd, terms, whole : as for `fit_modes`
    known : poles outside the band with which the search begins

    Returns
    -------
    with the modes outside the band marked as `outside`

    Raises
    ------
    FemtuneError : as `fit_modes`
    """
    search = _Search(frfs, np.asarray(start, complex), sd, terms, whole)
    fit = fit_modes(frfs, start, sd, terms, neighbours=known, whole=whole)
    while True:
        sides = [above for above in (False, True) if _number(fit, above=above) < MOST]
        trials = [trial for above in sides if (trial := search.refined(fit, (above,))) is not None]
        # the side that explains more first: what it leaves hides what the other side does
        best = min(trials, key=lambda trial: trial.deviance, default=None)
        if not fit.outside.any():
            # beside strong modes on both sides, one alone draws the modes inside to the place of the other
            both = search.refined(fit, (False, True))
            if both is not None and (best is None or explains(both, best)):
                best = both
        if best is None:
            return fit
        fit = best


def _number(fit: ModalFit, *, above: bool) -> int:
    """Number of modes on one side of the band."""
    freq, lines = freq_and_damping(fit.poles[fit.outside])[0], fit.measured.freq_hz
    return int(np.sum(freq > lines[-1]) if above else np.sum(freq < lines[0]))


@dataclass(frozen=True, eq=False)
class _Search:
    frfs: FrfSet
    start: Complexes
    sd: Reals | None
    terms: OutsideTerms
    whole: WholeRecord | None

    def fit(self, inside: Complexes, neighbours: Complexes, below: float) -> ModalFit | None:
        """None if neighbours come so close to each other that their residues are not unique."""
        try:
            return fit_modes(
                self.frfs, inside, self.sd, self.terms, neighbours=neighbours, whole=self.whole, below=below
            )
        except np.linalg.LinAlgError:
            return None

    def _deviance(self, poles: Complexes) -> float:
        """Deviance of the fit with these poles; infinite if their residues are not unique."""
        try:
            if self.whole is None:
                return deviance_at(self._some, poles, self._some_sd, self.terms)
            some = self.whole.thinned(ENOUGH_LINES)
            return deviance_at(some.frfs, poles, None, self.terms, some)
        except np.linalg.LinAlgError:
            return float("inf")

    @cached_property
    def _some(self) -> FrfSet:
        """Functions by which places are compared: of those with weights of their own, evenly chosen lines."""
        return self.frfs if self.sd is None else at_lines(self.frfs, self._every_so_many)

    @cached_property
    def _some_sd(self) -> Reals | None:
        return None if self.sd is None else self.sd[:, :, self._every_so_many]

    @property
    def _every_so_many(self) -> Flags:
        n, u, k = self.frfs.values.shape
        least = 4 * (len(self.start) + 2 * MOST + len(self.terms))
        step = max(min(n * u * k // _ENOUGH_VALUES, k // least), 1)
        return np.asarray(np.arange(k) % step == 0)

    def refined(self, fit: ModalFit, sides: tuple[bool, ...]) -> ModalFit | None:
        """The fit with a mode on each of the sides (True: above); None if they explain no more than noise does."""
        lines = fit.measured.freq_hz
        if 2 * len(lines) <= 2 * (len(fit.poles) + len(sides)) + len(self.terms):
            return None
        known, inside = fit.poles[fit.outside], self._inside(fit)
        grids = [self._grid(lines, above=above, more=len(sides) == 1) for above in sides]
        places = [np.array(poles) for poles in itertools.product(*grids)]
        deviances = [self._deviance(np.concatenate([inside, known, poles])) for poles in places]
        best = places[int(np.argmin(deviances))]
        if not np.isfinite(min(deviances)):
            return None
        trial = self.fit(inside, np.append(known, best), fit.deviance - by_chance(fit, len(sides)))
        return trial if trial is not None and _is_sound(trial) and explains(trial, fit) else None

    def _grid(self, lines: Reals, *, above: bool, more: bool) -> Complexes:
        """Poles at some distances from the band, damped as the modes are; with `more`, also four times as much."""
        gaps = np.array(GAPS)
        at = lines[-1] * (1.0 + gaps) if above else lines[0] * (1.0 - gaps)
        typical = max(float(np.median(freq_and_damping(self.start)[1])), _LEAST_DAMPING)
        damping = [min(one, _MOST_DAMPING) for one in ((typical, 4.0 * typical) if more else (typical,))]
        return pole_of(np.repeat(at, len(damping)), np.tile(damping, len(at)))

    def _inside(self, fit: ModalFit) -> Complexes:
        """Where the modes begin: at the fit; at the start before there are neighbours, or if one has left the band."""
        lines, inside = fit.measured.freq_hz, fit.poles[~fit.outside][np.argsort(fit.begun_at[~fit.outside])]
        freq = freq_and_damping(inside)[0]
        stayed = fit.outside.any() and freq.min() >= lines[0] and freq.max() <= lines[-1]
        return inside if stayed else self.start


def _is_sound(fit: ModalFit) -> bool:
    """Whether the neighbours are outside the band, though not far from it, and are not twice the same."""
    lines, poles = fit.measured.freq_hz, fit.poles[fit.outside]
    freq = freq_and_damping(poles)[0]
    apart = np.abs(poles[:, None] - poles)[np.triu_indices(len(poles), 1)]
    if (apart < APART * np.abs(poles.real).min()).any():
        return False
    below = (freq < lines[0]) & (freq > lines[0] / _FARTHEST)
    above = (freq > lines[-1]) & (freq < lines[-1] * _FARTHEST)
    return fit.converged and bool((below | above).all())


def explains(trial: ModalFit, fit: ModalFit) -> bool:
    """Whether two further numbers of each pole and two of each function lower the errors by more than chance."""
    return gain(trial, fit) > by_chance(fit, len(trial.poles) - len(fit.poles))


def by_chance(fit: ModalFit, more: int, chance: float = CHANCE) -> float:
    """The decrease of −2 log likelihood by further poles that noise explains with this probability."""
    n, u, _ = fit.measured.values.shape
    return float(chdtri(more * (2 + 2 * n * u), chance))


def gain(trial: ModalFit, fit: ModalFit) -> float:
    """Decrease of −2 log likelihood, of noise that is as large as the errors that are left.

    Where the noise is found from the errors, each function has only as many of them as its numbers leave free. The
    decrease by chance is larger in proportion, and is reduced to what it is with many lines.
    """
    gain = fit.deviance - trial.deviance
    if np.isfinite(trial.misfit):
        return gain / max(trial.misfit, 1.0)
    errors, numbers = 2 * len(trial.measured.freq_hz), 2 * len(trial.poles) + trial.terms.shape[2]
    return gain * (errors - numbers) / errors
