"""Whether frequencies of test and model differ by a factor that mistaken units cause."""

from __future__ import annotations

import numpy as np

from femtune.arrays import Reals
from femtune.correlation.pairing import Pairing
from femtune.errors import Notice
from femtune.modal import ModeSet
from femtune.modal.shape_criteria import mac_where_defined

FACTORS = {
    1e6: "coordinates in millimetres and sections in metres, or the reverse (the square of 1000)",
    25.4: "lengths in inches and in millimetres (25.4)",
    25.4**2: "coordinates in inches and sections in millimetres, or the reverse (the square of 25.4)",
    1.0 / 0.0254: "lengths in inches and in metres (39.37)",
    0.0254**-2: "coordinates in inches and sections in metres, or the reverse (the square of 39.37)",
    1000.0: "a modulus or length in other units (the square root of 1e6)",
    1000.0**0.5: "kilograms and tonnes (the square root of 1000)",
    386.0886**0.5: "weight instead of mass in inches (the square root of 386.09)",
    9806.65**0.5: "weight instead of mass in millimetres (the square root of 9807)",
    9.80665**0.5: "weight instead of mass in metres (the square root of 9.81)",
    32.174**0.5: "weight instead of mass in feet (the square root of 32.17)",
    2.0 * np.pi: "rad/s and Hz",
    60.0: "revolutions per minute and Hz",
}
"""Ratios of frequencies, or their inverses, and what causes them."""

_OF_MASS = {
    1000.0: "kilograms and tonnes",
    1e6: "grams and tonnes",
    386.0886: "weights in place of masses in inches",
    9806.65: "weights in place of masses in millimetres",
    9.80665: "weights in place of masses in metres",
    32.174: "weights in place of masses in feet",
    2.20462: "pounds and kilograms",
}
"""Ratios of masses, or their inverses, and what causes them."""
_MASS_TOLERANCE = 0.05
"""Logarithm of a ratio of masses over a factor between units, up to which the factor explains it."""


def mass_factor_words(ratio: float) -> str:
    """Cause of a ratio of the mass of the model to the measured one, and how to correct it; "" if no factor is near."""
    if not ratio > 0.0:
        return ""
    size = max(ratio, 1.0 / ratio)
    factor = min(_OF_MASS, key=lambda known: abs(np.log(size / known)))
    if abs(np.log(size / factor)) > _MASS_TOLERANCE:
        return ""
    wtmass = 1.0 / factor if ratio > 1.0 else factor
    return f"the ratio {ratio:.4g} is caused by {_OF_MASS[factor]}: multiply PARAM,WTMASS of the deck by {wtmass:.5g}"


_FREQUENCY_TOLERANCE = 0.12
"""Logarithm of the median ratio of frequencies over a factor between units, up to which the factor explains it: models
are wrong by as much."""
_LARGEST_SPREAD = 0.15
"""Logarithm of the ratio of a single mode over the median, beyond which no common factor explains all modes."""
_LEAST_MAC = 0.7
"""MAC of pairs that are found by shape alone, the frequencies being in doubt: above the usual gate of 0.5."""
_LEAST_PAIRS = 2
"""Pairs without which a common factor cannot be told from a single error."""
_RIGID = 1e-3
"""Frequency relative to the highest one, at or below which a mode is a rigid-body motion."""


def unit_factor(test: ModeSet, model: ModeSet, pairing: Pairing) -> tuple[Notice, ...]:
    """A warning where modes of the same shapes have frequencies in one ratio, and mistaken units cause that ratio.

    At least two test modes must have a MAC of 0.7 with a mode of the model of any frequency; their ratios must
    agree within 15 % and be within 12 % of one of the factors. Where half of the test modes are paired, no ratio is
    looked for.
    """
    if 2 * len(pairing.pairs) >= len(test):
        return ()
    ratios = _ratios(test, model)
    if len(ratios) < _LEAST_PAIRS:
        return ()
    ratio = float(np.median(ratios))
    if np.abs(np.log(ratios / ratio)).max() > _LARGEST_SPREAD:
        return ()
    size = max(ratio, 1.0 / ratio)
    factor = min(FACTORS, key=lambda known: abs(np.log(size / known)))
    if abs(np.log(size / factor)) > _FREQUENCY_TOLERANCE:
        return ()
    word = "higher" if ratio > 1.0 else "lower"
    cause, mend = FACTORS[factor], _mend(factor, ratio)
    return (Notice("correlate.unit-factor", modes=len(ratios), ratio=size, word=word, cause=cause, mend=mend),)


_OF_TEST = {60.0: "revolutions per minute", 2.0 * np.pi: "rad/s"}


def _mend(factor: float, ratio: float) -> str:
    """The smallest change that removes the ratio of the model's frequencies to those of the test."""
    if factor in _OF_TEST:
        return f"state the frequencies of {'the model' if ratio > 1.0 else 'the test'} in Hz, not in {_OF_TEST[factor]}"
    by = factor**2 if ratio > 1.0 else factor**-2
    return f"PARAM,WTMASS of the deck times {by:.5g} or moduli times {1.0 / by:.5g} would remove it"


def _ratios(test: ModeSet, model: ModeSet) -> Reals:
    """Model frequency by test frequency of the modes that are most similar to each other."""
    if not len(test) or not len(model):
        return np.zeros(0)
    macs = np.nan_to_num(mac_where_defined(test.shapes, model.shapes))
    elastic = model.freq_hz > _RIGID * model.freq_hz.max()
    macs = np.where(elastic, macs, 0.0)
    best = macs.argmax(axis=1)
    pairs = [(i, j) for i, j in enumerate(best) if macs[i, j] >= _LEAST_MAC and macs[:, j].argmax() == i]
    return np.array([model.freq_hz[j] / test.freq_hz[i] for i, j in pairs if test.freq_hz[i] > 0.0])
