"""Simulated modal test from the modes of a model: at sensors, with random errors, as Universal File."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Reals
from femtune.dofs import DIRECTIONS, Dof, DofSet, parse_dof
from femtune.errors import FemtuneError, Where
from femtune.files.study_file.kinds import support
from femtune.files.uff import write_uff_modes
from femtune.journal.run_files import numbered
from femtune.modal import ModeSet, entry_deviations, largest_entries
from femtune.model.response.rigid import is_rigid
from femtune.steps.respond.run import id_line
from femtune.testdata import ModalTest, WireFrame, sensors_at
from femtune.units import unit_system

if TYPE_CHECKING:
    from femtune.fem.structure import NodeTable
    from femtune.model import EigenSolution
    from femtune.study.cases import StudyCase
    from femtune.study.study import Study


@dataclass(frozen=True)
class SimulatedTest:
    """A test that is wanted of a model's modes.

    Parameters
    ----------
    path : Universal File to write; with several configurations each has its own, with its number in the name; None
        where none is wanted
    sensors : ``"12Z+"``, or nodes and components: ``"101 THRU 160:123"``, along the displacement axes of the points
    units : length-mass-s of a deck alone, which does not state them
    frequency_scatter : standard deviation of each frequency, relative to it
    shape_scatter : standard deviation at each sensor, relative to the largest entry of the shape
    seed : of the random errors
    """

    path: Path | None
    sensors: tuple[str, ...]
    units: str | None = None
    frequency_scatter: float = 0.0
    shape_scatter: float = 0.0
    seed: int = 1


def check_simulated(study: Study, wanted: SimulatedTest) -> None:
    """Refuse, before anything is solved, what cannot be written.

    Raises
    ------
    FemtuneError : ``response.units-needed``, ``response.units-given``, ``uff.cannot-write``, ``model.unknown-node``,
        ``dof.syntax``, ``dof.duplicate``, ``study.support``, ``response.noise``
    """
    if study.units_known and wanted.units is not None:
        raise FemtuneError("response.units-given", where=study.file.where("study", "units"))  # fmt: skip
    if not study.units_known and wanted.units is None:
        raise FemtuneError("response.units-needed", where=Where(str(study.file.path)))  # fmt: skip
    for name in ("frequency_scatter", "shape_scatter"):
        if not 0.0 <= getattr(wanted, name) < np.inf:
            raise FemtuneError("response.noise", values={name: getattr(wanted, name)})
    if wanted.seed < 0:
        raise FemtuneError("response.noise/seed", values={"seed": wanted.seed})
    nodes = study.model.structure.nodes
    dofs = sensor_dofs(wanted.sensors)
    for dof in dofs:
        nodes.dof(dof.node, dof.component)
    _measured(nodes, dofs)
    if wanted.path is not None and 0 < sum(map(nodes.has_scalar, dofs.nodes.tolist())) < len(dofs):
        raise FemtuneError("uff.cannot-write/scalar-point", where=Where(str(wanted.path)))


def sensor_dofs(sensors: Sequence[str]) -> DofSet:
    """The sensors, each once (errors ``dof.syntax``, ``study.support``; ``uff.cannot-write`` for none)."""
    dofs = dict.fromkeys(dof for text in sensors for dof in _named(text))
    if not dofs:
        raise FemtuneError("uff.cannot-write/no-sensors")  # fmt: skip
    return DofSet(tuple(dofs))


def _named(text: str) -> Iterable[Dof]:
    if ":" not in text:
        return [parse_dof(text.strip())]
    return [Dof(node, DIRECTIONS[int(c)]) for node, components in support(text) for c in components]


def _measured(nodes: NodeTable, dofs: DofSet) -> DofSet:
    """The sensors, component 1 of a scalar point as the scalar point itself (error ``dof.duplicate``)."""
    return DofSet(replace(d, direction="S") if nodes.has_scalar(d.node) else d for d in dofs)


def write_simulated(study: Study, wanted: SimulatedTest, solutions: Sequence[tuple[StudyCase, EigenSolution]]) -> None:
    """A Universal File of each configuration's modes (error ``uff.cannot-write``); rigid-body motions are left out."""
    assert wanted.path is not None
    for path, test in zip(numbered(wanted.path, len(study.cases)), simulated(study, wanted, solutions)):
        write_uff_modes(path, test, ("simulated by femtune",))


def simulated(
    study: Study, wanted: SimulatedTest, solutions: Sequence[tuple[StudyCase, EigenSolution]]
) -> list[ModalTest]:
    """The modes of each configuration at the sensors, with random errors."""
    chance = np.random.default_rng(wanted.seed)
    return [_simulated(study, case, solution, wanted, chance) for case, solution in solutions]


_LARGE_ENTRY = 0.618
"""Part of the largest entry of a shape from which an entry may determine its sign. The largest entry itself would not
do: shapes of symmetric structures have several, and rounding decides among them. No ratio of entries of such shapes is
this one."""


def shape_signs(shapes: Reals) -> Reals:
    """(m,) signs that make the first large entry of each real shape (n, m) positive.

    The sign that the eigen-solution gives depends on the processor; errors that are added to a shape would then differ.

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.steps.modes.simulated_test import shape_signs
    >>> shape_signs(np.array([[0.1, 1.0], [-0.9, 0.2], [1.0, -1.0]]))
    array([-1.,  1.])
    """
    large = np.abs(shapes) >= _LARGE_ENTRY * largest_entries(shapes)
    first = np.take_along_axis(shapes, large.argmax(axis=0)[None, :], axis=0)[0]
    return np.where(first < 0.0, -1.0, 1.0)


def _simulated(
    study: Study, case: StudyCase, solution: EigenSolution, wanted: SimulatedTest, chance: np.random.Generator
) -> ModalTest:
    nodes = study.model.structure.nodes
    dofs = _measured(nodes, sensor_dofs(wanted.sensors))
    rows, signs = [nodes.dof(d.node, d.component) for d in dofs], np.array([d.sign for d in dofs])
    elastic = ~is_rigid(solution)[: solution.wanted]
    freq = solution.freq_hz[elastic]
    motion = case.configured.transformation[rows] @ solution.shapes[:, : solution.wanted][:, elastic]
    shapes = signs[:, None] * motion * shape_signs(motion)
    freq = freq * (1.0 + wanted.frequency_scatter * chance.standard_normal(freq.shape))
    shapes = shapes + entry_deviations(wanted.shape_scatter, shapes) * chance.standard_normal(shapes.shape)
    at = np.array([nodes.position(n) for n in sorted({d.node for d in dofs if d.component})], dtype=int)
    frame = WireFrame(nodes.ids[at], nodes.xyz[at], nodes.frames[at].transpose(0, 2, 1))
    units = study.file.study.unit_system if study.units_known else unit_system(str(wanted.units))
    modes = ModeSet(freq, shapes, dofs, source="simulated")
    return ModalTest(id_line(case.name), units, frame, sensors_at(frame, dofs), modes=modes)
