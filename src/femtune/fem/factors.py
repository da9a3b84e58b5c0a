"""Factors of whole element matrices: K_e, M_e and C_e of a group times one number.

The simplest parameters (Friswell and Mottershead 1995, section 5.2): the elements of a group share one factor, and the
matrices are linear in it.
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
    words : keys of ``FACTORS``; the factor of the stiffness also multiplies its hysteretic part
    """
    refs = {word: factor_ref(word) for word in words}
    values = structure.values.extended(dict.fromkeys(refs.values(), 1.0))
    at = {word: values.index(ref) for word, ref in refs.items()}
    batches = tuple(_with_roles(b, {word: i for word, i in at.items() if i is not None}) for b in structure.batches)
    return replace(structure, values=values, batches=batches)


def _with_roles(batch: ElementBatch, at: Mapping[str, int]) -> ElementBatch:
    return replace(batch, roles={**batch.roles, **{word: np.full(len(batch), i) for word, i in at.items()}})


def factored(parts: list[Contribution], batch: ElementBatch) -> list[Contribution]:
    """Contributions of a batch, multiplied by its factors."""
    words = {kind: word for word, kind in FACTORS.items() if word in batch.roles}
    return [times(p, words[p.matrix]) if p.matrix in words else p for p in parts]
