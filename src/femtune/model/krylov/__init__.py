"""Eigenpairs by block Lanczos with thick restarts: the basis, one step, and the iteration."""

from femtune.model.krylov.basis import Basis
from femtune.model.krylov.iteration import Krylov, KrylovPairs, begin, beside, iterate
from femtune.model.krylov.orthonormal import column_products

__all__ = ["Basis", "Krylov", "KrylovPairs", "begin", "beside", "column_products", "iterate"]
