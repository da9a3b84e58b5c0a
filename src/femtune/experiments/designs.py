"""Designs of experiments: points of the unit cube, one row per run.

A design knows nothing of parameters. `levels` are those of a design by levels; a design that fills the space has none.
Sources: Box and Wilson 1951 (central composite), Plackett and Burman 1946, Qian 2009 (nested Latin hypercubes).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import product

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError
from femtune.experiments.arrays import columns_for, hadamard, orthogonal_array, smallest_array
from femtune.experiments.kinds import SampleWord

_MOST_RUNS = 1_000_000
"""Runs of a full factorial at most: more could not be made."""
_FACES = 1.0
"""Distance of the axial points of a face-centred design from the centre, in half edges."""


@dataclass(frozen=True, eq=False)
class Design:
    """Points of the unit cube.

    Parameters
    ----------
    name : what the design is
    points : (runs, factors) from 0 to 1
    levels : (runs, factors) levels from 0; None for a design that fills the space
    """

    name: str
    points: Reals
    levels: Integers | None = None


def by_levels(name: str, levels: Integers) -> Design:
    """A design whose levels of each factor are evenly spaced from 0 to 1."""
    return Design(name, levels / (levels.max(axis=0)), levels)


def orthogonal_design(counts: list[int], name: str | None = None) -> Design:
    """An orthogonal array for factors with these numbers of levels; None: the smallest that leaves error freedom.

    Raises
    ------
    FemtuneError : ``design.no-array``, ``design.unknown-array``, ``design.columns``
    """
    if name is None:
        array, columns = smallest_array(counts)
        return by_levels(array.name, array.levels[:, columns])
    array = orthogonal_array(name)
    fitting_columns = columns_for(array, counts)
    if fitting_columns is None:
        raise FemtuneError("design.columns", name=name, structure=array.structure, counts=", ".join(map(str, counts)))
    return by_levels(name, array.levels[:, fitting_columns])


def full_factorial(counts: list[int]) -> Design:
    """All combinations of levels.

    Raises
    ------
    FemtuneError : ``design.too-many``
    """
    runs = int(np.prod([float(c) for c in counts]))
    if runs > _MOST_RUNS:
        raise FemtuneError("design.too-many", runs=runs, most=_MOST_RUNS)
    return by_levels("full factorial", np.array(list(product(*map(range, counts)))))


def plackett_burman(factors: int) -> Design:
    """The smallest design of two levels with a multiple of four runs, at least one more than there are factors.

    Raises
    ------
    FemtuneError : ``design.runs``
    """
    runs = 4 * (factors // 4 + 1)
    return by_levels(f"Plackett-Burman {runs}", (1 - hadamard(runs)[:, 1 : factors + 1]) // 2)


def central_composite(factors: int, centres: int = 1, rotatable: bool = False) -> Design:
    """Corners of the cube, two axial points per factor, and centres; all within the unit cube.

    Parameters
    ----------
    factors : up to 12
    centres : number of runs at the centre
    rotatable : axial points on the faces and corners within the cube, at the ratio 2^(k/4) of the distances, so that
        the variance of a quadratic prediction depends on the distance from the centre only; otherwise both are on the
        faces

    Raises
    ------
    FemtuneError : ``design.too-many``
    """
    if factors > 12:
        raise FemtuneError("design.too-many", runs=2.0**factors, most=2**12)
    axial = 2.0 ** (factors / 4.0) if rotatable else _FACES
    corners = np.array(list(product((-1.0, 1.0), repeat=factors)))
    axes = np.vstack([axial * np.eye(factors), -axial * np.eye(factors)])
    signed = np.vstack([corners, axes, np.zeros((centres, factors))]) / max(axial, 1.0)
    return Design("central composite", 0.5 * (1.0 + signed))


def latin_hypercube(factors: int, runs: int, seed: int = 0, optimised: bool = True) -> Design:
    """Each of `runs` equal intervals of each factor has one point; pairs exchanged for a low discrepancy."""
    from scipy.stats import qmc  # noqa: PLC0415  half a second that other designs do not need

    way = "random-cd" if optimised and runs > 1 else None
    return Design("Latin hypercube", qmc.LatinHypercube(factors, optimization=way, rng=seed).random(runs))


def nested_latin_hypercube(factors: int, first: int, times: int, seed: int = 0) -> Design:
    """A Latin hypercube of first·times runs whose first `first` runs are a Latin hypercube themselves."""
    rng = np.random.default_rng(seed)
    runs = first * times
    columns = []
    for _ in range(factors):
        coarse = rng.permutation(first)
        chosen = coarse * times + rng.integers(times, size=first)
        others = rng.permutation(np.setdiff1d(np.arange(runs), chosen))
        columns.append((np.concatenate([chosen, others]) + rng.random(runs)) / runs)
    return Design("nested Latin hypercube", np.stack(columns, axis=1))


def sample(word: SampleWord, factors: int, runs: int, seed: int = 0) -> Design:
    """The design of a word, with so many runs; a nested one has one more where the number is odd.

    Raises
    ------
    FemtuneError : ``design.too-many`` for a central composite design of many factors

    Examples
    --------
    >>> sample("central-composite", 3, 10).points.shape
    (15, 3)
    """
    if word == "central-composite":
        return central_composite(factors)
    if word == "nested-latin-hypercube":
        return nested_latin_hypercube(factors, (runs + 1) // 2, 2, seed)
    return sobol(factors, runs, seed) if word == "sobol" else latin_hypercube(factors, runs, seed)


def sobol(factors: int, runs: int, seed: int = 0) -> Design:
    """The first points of a scrambled Sobol sequence; balanced where their number is a power of two."""
    from scipy.stats import qmc  # noqa: PLC0415  half a second that other designs do not need

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="The balance properties")
        return Design("Sobol sequence", qmc.Sobol(factors, rng=seed).random(runs))
