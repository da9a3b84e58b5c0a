"""The finite element kernel: structures as arrays, elements as exact terms, constraints, checks."""

from femtune.fem.assembled import AssembledMatrix
from femtune.fem.contribution import Contribution, product
from femtune.fem.structure import (
    ConstraintRows,
    ElementBatch,
    NodeTable,
    OverallDamping,
    Structure,
    join_constraints,
    no_constraints,
)
from femtune.fem.values import Derived, FieldRef, ValueTable, ValueTableBuilder

__all__ = [
    "AssembledMatrix",
    "ConstraintRows",
    "Contribution",
    "Derived",
    "ElementBatch",
    "FieldRef",
    "NodeTable",
    "OverallDamping",
    "Structure",
    "ValueTable",
    "ValueTableBuilder",
    "join_constraints",
    "no_constraints",
    "product",
]
