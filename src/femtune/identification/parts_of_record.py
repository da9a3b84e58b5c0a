"""Do parts of a record agree on the poles? What noise does not explain is part of their standard deviations.

The likelihood of a record holds for a structure that is linear and does not change. Where frequencies or damping differ
from hit to hit, from burst to burst or in the course of a record, the errors that the fit leaves are no noise: in each
part of the time they want other poles. The poles of all lines are a sum of what each part adds to them, and the scatter
of these parts is the covariance, whatever its cause (sandwich, White 1982). It is taken where the scatter is larger
than noise explains.

Source: H. White (1982), Maximum likelihood estimation of misspecified models, Econometrica 50.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.special import chdtri, stdtrit

from femtune.arrays import Complexes, Flags, Integers, Reals
from femtune.identification.force_noise import LinesOfRecord, lines_at, noise_of, slopes_of_function
from femtune.identification.modal_fit import ModalFit
from femtune.identification.modal_solve import OUT_OF_BAND, OutsideTerms
from femtune.identification.whole_record import WholeRecord

CHANCE = 1e-3
"""Parts disagree on a mode where noise explains their scatter with a smaller probability."""
PARTS = 6
"""Equal parts of a record whose force does not pause."""
MOST_PARTS = 40
"""Hits or bursts at most that are parts; more are joined."""
LEAST_PARTS = 3
"""Parts that know something of a mode, at least."""
TREND_CHANCE = 0.01
"""Probability with which a frequency that does not follow the force is said to, where parts disagree on the mode."""
POWERS = (0.0, 2.0)
"""Powers of the force with which a frequency may change: 0 stands for its logarithm."""
LEAST_RATIO = 1.25
"""Ratio of the largest force to the smallest from which a trend is looked for."""
TREND_PARTS = 4
"""Parts that a trend needs."""
LEAST_SHARE = 0.3
"""Information on a mode, over the mean of the parts, below which a part of the time does not count."""
MOST_NUMBERS = 20_000_000
"""Slopes of the columns with the poles up to which the parts are looked at: 320 MB."""
QUIET = 0.01
"""Mean square of the force over its largest below which it pauses."""
_WINDOWS = 400
"""Windows of the record over which the mean square of the force is taken."""
_NORMAL = 1.96
"""Quantile of the normal distribution by which intervals are drawn."""


def with_parts_of_time(fit: ModalFit, whole: WholeRecord, terms: OutsideTerms = OUT_OF_BAND) -> ModalFit:
    """The fit of a whole record with the scatter of its poles over parts of the time.

    Returns
    -------
    with `by_parts`, `by_noise`, `by_force` and a larger `pole_covariance` where parts disagree on a mode; else as it is
    """
    if 4 * len(fit.poles) * len(whole.force) > MOST_NUMBERS:
        return fit
    now = lines_at(fit.poles, whole, terms)
    noise = noise_of(now)
    left = np.sum(np.abs(now.left) ** 2, axis=1) / (2.0 * now.free.sum())
    variance, force = (np.maximum(left, np.finfo(float).tiny), 0.0) if noise is None else noise
    begin, samples = _parts(whole)
    if len(begin) < LEAST_PARTS:
        return fit
    moved, expected, raised = _of_parts(now, variance, force, whole, begin, samples)
    m = len(fit.poles)
    times, trend, total = np.ones(m), np.full((m, 2), np.nan), fit.pole_covariance.copy()
    size = np.sqrt(np.add.reduceat(_in_time(whole.force, whole, samples) ** 2, begin))
    for r in np.flatnonzero(~fit.outside).tolist():
        of = [r, m + r]
        s, V = moved[:, of], expected[:, of][:, :, of] * raised[r]
        share = np.trace(V, axis1=1, axis2=2) / np.trace(V.mean(axis=0))
        known = share > LEAST_SHARE
        s, V = s[known], V[known]
        if len(s) < LEAST_PARTS:
            continue
        # what each part adds beyond its share of the sum, which is zero but for the parts that do not count
        s = s - V @ np.linalg.solve(V.sum(axis=0), s.sum(axis=0))
        far = float(np.sum(s * np.linalg.solve(V, s[:, :, None])[:, :, 0]))
        freedom = 2 * (len(s) - 1)
        if far <= float(chdtri(freedom, CHANCE)):
            continue
        times[r] = np.sqrt(far / freedom)
        trend[r] = _with_force(s, V, size[known])
        trend[r, 0] /= fit.poles[r].imag
        more = _scatter(s, V) - V.sum(axis=0)
        value, vector = np.linalg.eigh(more)
        total[np.ix_(of, of)] += (vector * np.maximum(value, 0.0)) @ vector.T
    if not (times > 1.0).any():
        return fit
    before, after = (np.diag(c).reshape(2, m).sum(axis=0) for c in (fit.pole_covariance, total))
    return replace(fit, pole_covariance=total, by_parts=times, by_noise=np.sqrt(before / after), by_force=trend)


def _with_force(s: Reals, V: Reals, size: Reals) -> tuple[float, float]:
    """The change of Im λ from the smallest to the largest force, and the ratio of these; NaN where none is seen.

    The parts' own Im λ are a straight line over the logarithm or the square of the force (Student's t over what the
    line leaves, which is taken no smaller than noise).

    Parameters
    ----------
    s, V : (b, 2), (b, 2, 2) what each part adds to the sum of all and its covariance by noise
    size : (b,) of the force
    """
    ratio = float(size.max() / size.min())
    if len(s) < TREND_PARTS or not LEAST_RATIO <= ratio < np.inf:
        return np.nan, np.nan
    # the poles that each part wants by itself
    own = V.sum(axis=0) @ np.linalg.inv(V)
    values = (own @ s[:, :, None])[:, 1, 0]
    weight = 1.0 / (own @ V @ own.transpose(0, 2, 1))[:, 1, 1]
    freedom = len(s) - 2
    least = float(stdtrit(freedom, 1.0 - 0.5 * TREND_CHANCE / len(POWERS)))
    best, change = least, np.nan
    for power in POWERS:
        x = np.log(size / size.max()) if power == 0.0 else (size / size.max()) ** power
        off, of = x - np.average(x, weights=weight), values - np.average(values, weights=weight)
        spread = float(np.sum(weight * off**2))
        slope = float(np.sum(weight * off * of)) / spread
        left = max(float(np.sum(weight * (of - slope * off) ** 2)) / freedom, 1.0)
        t = abs(slope) * np.sqrt(spread / left)
        if t > best:
            best, change = t, slope * float(x.max() - x.min())
    return (float(change), ratio) if np.isfinite(change) else (np.nan, np.nan)


def _scatter(s: Reals, V: Reals) -> Reals:
    """(2, 2) covariance of the sum of parts s (b, 2), which add to zero; V (b, 2, 2) are those of noise alone.

    It is that of the jackknife, in which parts that know more count more, wide enough for intervals of 1.96 standard
    deviations although the parts are few.
    """
    share = np.trace(V, axis1=1, axis2=2) / np.trace(V.sum(axis=0))
    without = np.linalg.solve(np.eye(2) - V @ np.linalg.inv(V.sum(axis=0)), s[:, :, None])[:, :, 0]
    freedom = max(1.0 / float(np.sum(share**2)) - 1.0, 1.0)
    few = (float(stdtrit(freedom, 0.975)) / _NORMAL) ** 2
    return np.asarray(few * (len(s) - 1) / len(s) * np.einsum("ba,bc->ac", without, without))


def _parts(whole: WholeRecord) -> tuple[Integers, int]:
    """First samples of the parts and the samples of the record: parts begin with hits or bursts, where the force pauses
    between them, and are equal else."""
    freq = whole.frfs.freq_hz
    samples = round(1.0 / (whole.step_s * float(np.median(np.diff(freq)))))
    power = _in_time(whole.force, whole, samples) ** 2
    width = max(samples // _WINDOWS, 1)
    smooth = uniform_filter1d(power, width)
    active: Flags = smooth > QUIET * smooth.max()
    # pauses that are no longer than a window are none
    quiet = uniform_filter1d((~active).astype(float), 2 * width + 1) > 1.0 - 1e-9
    starts = np.flatnonzero(active & (np.concatenate([[True], ~active[:-1]])))
    starts = np.array([s for s in starts.tolist() if quiet[max(s - width - 1, 0)] or s <= 3 * width], dtype=int)
    if len(starts) < LEAST_PARTS:
        return np.linspace(0, samples, PARTS, endpoint=False).astype(int), samples
    step = -(-len(starts) // MOST_PARTS)
    return np.unique(np.concatenate([[0], np.maximum(starts[::step][1:] - width, 1)])), samples


def _in_time(lines: Complexes, whole: WholeRecord, samples: int) -> Reals:
    """(…, samples) of what has the lines (…, k) of the record, and no others."""
    at = np.rint(whole.frfs.freq_hz * whole.step_s * samples).astype(int)
    spectrum = np.zeros((*lines.shape[:-1], samples // 2 + 1), complex)
    spectrum[..., at] = lines
    return np.asarray(np.fft.irfft(spectrum, samples))


def _of_parts(
    now: LinesOfRecord, variance: Reals, force: float, whole: WholeRecord, begin: Integers, samples: int
) -> tuple[Reals, Reals, Reals]:
    """What each part moves the poles by (b, 2m), the covariance (b, 2m, 2m) of noise, and by how much the noise of the
    force raises that of each pole (m,)."""
    n, phase = len(variance), whole.force / np.abs(whole.force)
    normal = sum(_gram(slopes_of_function(now, f, variance)) for f in range(n))
    inverse = np.linalg.pinv(np.asarray(normal), hermitian=True)
    q, bounds = len(inverse), [*begin.tolist(), samples]
    moved, expected, shared = (
        np.zeros((len(begin), q)),
        np.zeros((len(begin), q, q)),
        np.zeros((len(phase), q), complex),
    )
    for f in range(n):
        effect = slopes_of_function(now, f, variance) @ inverse
        # the fit divides by the force; as part of the response an error is where it was
        error = _in_time(now.left[f] / np.sqrt(variance[f]) * phase, whole, samples)
        weight = _in_time((effect * phase[:, None]).T, whole, samples)
        moved += 0.5 * samples * np.add.reduceat(weight * error, begin, axis=1).T
        both = [weight[:, a:b] @ weight[:, a:b].T for a, b in pairwise(bounds)]
        expected += 0.5 * samples * np.array(both)
        shared += (now.loaded[f] / np.sqrt(variance[f])).conj()[:, None] * effect
    raised = 1.0 + force * np.sum(np.abs(shared) ** 2, axis=0) / np.diag(inverse)
    return moved, expected, np.maximum(raised[: q // 2], raised[q // 2 :])


def _gram(slopes: Complexes) -> Reals:
    return np.asarray((slopes.conj().T @ slopes).real)
