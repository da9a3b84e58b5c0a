"""Factors of whole element matrices: K_e, M_e and C_e of a group times a number of its own.

The simplest parameters there are (Friswell and Mottershead 1995, section 5.2): what multiplies a group is one value
that its elements share, and the matrices are linear in it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from femtune.fem.contribution import Contribution, times
from femtune.fem.fields import FACTORS, factor_ref
from femtune.fem.structure import ElementBatch, Structure


def with_factors(structure: Structure, words: Collection[str]) -> Structure:
    """The structure whose element matrices have factors, 1 as long as no parameter moves them.

    Parameters
    ----------
    words : of ``FACTORS``; the factor of the stiffness multiplies the hysteretic part that goes with it too
    """
    refs = {word: factor_ref(word) for word in words}
    values = structure.values.extended(dict.fromkeys(refs.values(), 1.0))
    at = {word: values.index(ref) for word, ref in refs.items()}
    batches = tuple(_with_roles(b, {word: i for word, i in at.items() if i is not None}) for b in structure.batches)
    return replace(structure, values=values, batches=batches)


def _with_roles(batch: ElementBatch, at: Mapping[str, int]) -> ElementBatch:
    return replace(batch, roles={**batch.roles, **{word: np.full(len(batch), i) for word, i in at.items()}})


def factored(parts: list[Contribution], batch: ElementBatch) -> list[Contribution]:
    """Contributions of a batch, times the factors that it has."""
    words = {kind: word for word, kind in FACTORS.items() if word in batch.roles}
    return [times(p, words[p.matrix]) if p.matrix in words else p for p in parts]
