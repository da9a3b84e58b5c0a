"""What solutions at a model point depend on, as digests."""

from __future__ import annotations

from femtune.fem.contribution import MatrixKind
from femtune.model.configured import ModelPoint
from femtune.model.digest import Part, digest


def matrices_digest(point: ModelPoint, *kinds: MatrixKind) -> str:
    """Digest of assembled matrices; how they depend on the parameters is no part of it."""
    return digest(*(part for kind in kinds for part in (kind, getattr(point, kind))))


def derivatives_digest(point: ModelPoint) -> str:
    """Digest of all matrices and their first derivatives: of the terms, and of their coefficients at the point.

    Much cheaper than the derivatives themselves, which are as many matrices as there are parameters.
    """
    coefficients = [part for c in point.coefficients if c is not None for part in (c.value, c.grad)]
    eta = point.loss_factor
    overall: tuple[Part, ...] = () if eta is None else (eta.value, eta.grad)
    return digest(point.configured.terms_digest, point.n_parameters, *coefficients, "overall", *overall)
