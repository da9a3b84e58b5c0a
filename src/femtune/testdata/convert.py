"""A whole test in other units, in the model's axes, or with other node numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.modal import FrfSet, ModeSet
from femtune.testdata.modal_test import ModalTest, Sensor, WireFrame
from femtune.units import UnitSystem


def convert_units(test: ModalTest, units: UnitSystem) -> ModalTest:
    """The same test in another system.

    Lengths scale; mass-normalised shapes scale with 1/√mass; in every shape rotations scale with 1/length
    against translations (1 rad stays 1 rad while the numbers of a displacement change); FRFs scale as
    (length or rad)/(force or moment).
    """
    length = units.length_from(test.units)
    return replace(
        test,
        units=units,
        geometry=replace_frame(test.geometry, coordinates=test.geometry.coordinates * length),
        sensors=tuple(Sensor(s.label, s.position * length, s.direction) for s in test.sensors),
        modes=None if test.modes is None else _modes(test.modes, test.units, units),
        frfs=None if test.frfs is None else convert_frfs(test.frfs, test.units, units),
    )


def replace_frame(frame: WireFrame, *, coordinates: NDArray, axes: NDArray | None = None) -> WireFrame:
    """`frame` with other coordinates, and other axes where given."""
    kept = frame.axes if axes is None else axes
    return WireFrame(frame.nodes, coordinates, kept, frame.lines, frame.elements)


def scaled_coordinates(test: ModalTest, factor: float) -> ModalTest:
    """The test with its coordinates times a factor, where its file states a wrong unit for them; shapes stay."""
    if factor == 1.0:
        return test
    return replace(
        test,
        geometry=replace_frame(test.geometry, coordinates=test.geometry.coordinates * factor),
        sensors=tuple(Sensor(s.label, s.position * factor, s.direction) for s in test.sensors),
    )


def _modes(modes: ModeSet, old: UnitSystem, new: UnitSystem) -> ModeSet:
    length, mass = new.length_from(old), new.mass_from(old)
    scale = 1.0 / np.sqrt(mass) if modes.normalisation == "mass" else 1.0
    factor = scale * np.where(_is_rotation(modes.dofs), 1.0 / length, 1.0)[:, None]
    spread = None if modes.shapes_sd is None else modes.shapes_sd * factor
    # a receptance of translations is a length by a force
    unit = scale**2 * (old.force / new.force) / length
    modal_a = None if modes.modal_a is None else np.asarray(modes.modal_a * unit, dtype=complex)
    return replace(modes, shapes=modes.shapes * factor, shapes_sd=spread, modal_a=modal_a)


def convert_frfs(frfs: FrfSet, old: UnitSystem, new: UnitSystem) -> FrfSet:
    """The same functions in another system."""
    length = new.length_from(old)
    force = old.force / new.force
    motion = np.where(_is_rotation(frfs.responses), 1.0, length)
    load = force * np.where(_is_rotation(frfs.references), length, 1.0)
    return replace(frfs, values=frfs.values * (motion[:, None] / load[None, :])[:, :, None])


def _is_rotation(dofs: DofSet) -> NDArray[np.bool_]:
    return dofs.components > 3


_ORTHOGONALITY = 1e-6
"""Largest entry of RRᵀ − 1 of a rotation: rotations that users write have six digits and more."""


def place(test: ModalTest, rotation: ArrayLike, origin: ArrayLike, *, allow_mirrored: bool = False) -> ModalTest:
    """The test in the model's frame: x_model = rotation @ x_test + origin.

    Parameters
    ----------
    rotation : (3, 3) orthonormal
    origin : (3,) where the test's origin lies in the model, in the test's length unit
    allow_mirrored : accept a rotation with determinant −1 (axes of rotations are turned round)

    Raises
    ------
    FemtuneError : ``test.rotation`` where it is not orthonormal, ``test.mirrored`` where it mirrors
    """
    turn, shift = np.asarray(rotation, dtype=float), np.asarray(origin, dtype=float)
    hand = _check_rotation(turn, shift, allow_mirrored)
    frame = test.geometry
    assert frame.axes is not None
    axes = frame.axes @ turn.T
    sensors = tuple(
        Sensor(s.label, turn @ s.position + shift, (hand if s.is_rotation else 1.0) * (turn @ s.direction))
        for s in test.sensors
    )
    placed = replace_frame(frame, coordinates=frame.coordinates @ turn.T + shift, axes=axes)
    return replace(test, geometry=placed, sensors=sensors)


def _check_rotation(turn: NDArray, shift: NDArray, allow_mirrored: bool) -> float:
    if turn.shape != (3, 3) or shift.shape != (3,) or not np.isfinite(shift).all():
        sizes = {"rotation": turn.shape, "origin": shift.shape}
        raise FemtuneError("test.rotation", values=sizes)
    error = float(np.max(np.abs(turn @ turn.T - np.eye(3))))
    if not error < _ORTHOGONALITY:
        raise FemtuneError(
            "test.rotation/not-orthonormal", values={"rotation": turn.tolist(), "largest deviation": error}
        )
    hand = float(np.sign(np.linalg.det(turn)))
    if hand < 0 and not allow_mirrored:
        raise FemtuneError("test.mirrored", values={"rotation": turn.tolist()})
    return hand


def renumber(test: ModalTest, numbers: Mapping[int, int]) -> ModalTest:
    """The test with other node numbers; nodes that `numbers` does not name keep theirs.

    Raises
    ------
    FemtuneError : ``test.duplicate-node``, ``dof.duplicate`` where two nodes would become one
    """

    def new(node: int) -> int:
        return int(numbers.get(node, node))

    def dof(old: Dof) -> Dof:
        return Dof(new(old.node), old.direction, old.sign)

    frame, modes, frfs = test.geometry, test.modes, test.frfs
    return replace(
        test,
        geometry=WireFrame(
            np.array([new(int(n)) for n in frame.nodes], dtype=np.int64),
            frame.coordinates,
            frame.axes,
            tuple(tuple(map(new, path)) for path in frame.lines),
            tuple(tuple(map(new, path)) for path in frame.elements),
        ),
        sensors=tuple(Sensor(dof(s.label), s.position, s.direction) for s in test.sensors),
        modes=None if modes is None else replace(modes, dofs=DofSet(map(dof, modes.dofs))),
        frfs=None
        if frfs is None
        else replace(frfs, responses=DofSet(map(dof, frfs.responses)), references=DofSet(map(dof, frfs.references))),
    )
