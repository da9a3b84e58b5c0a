"""The subframe as a model with parameters, free and with masses on its mounts, and the problem of its calibration.

Components are the same mesh with scattered thicknesses and moduli; two inputs, 47 or 56 channels.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from femtune.arrays import Reals
from femtune.fem import FieldRef, Structure
from femtune.files.nastran import build_structure, read_deck
from femtune.files.uff import write_uff_frfs
from femtune.modal import FrfSet
from femtune.model import (
    AddedMass,
    Assignment,
    Configuration,
    ConfiguredModel,
    EigenSolution,
    ParametricModel,
    configure,
    constant_damping,
    damping_by_mode,
    parametric_model,
    solve_modes,
)
from femtune.model.response import Ports, frf, make_ports
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import (
    CaseState,
    FrfResidual,
    FrfScatter,
    ModelWay,
    UpdateProblem,
    case_without_modes,
    frf_residual,
)
from femtune.residuals.frf.model_way import AtFirstState, Settled
from femtune.testdata import NO_GEOMETRY, ModalTest
from femtune.units import SI
from structures.subframe import MATERIALS, MOUNT_INERTIA, MOUNT_MASS, Subframe, subframe, write_subframe

STEEL, SHEET, RUBBER = 0.15, 0.20, 0.45
"""Bounds of moduli of steel, thicknesses and moduli of rubber, relative to the deck."""
SCATTER = 0.5
"""Truths are uniform within this part of the bounds."""
LEVEL = 0.002
"""σ of the noise of real and imaginary part, as a part of the largest magnitude of each FRF."""

ZETA_RUBBER, ZETA_STEEL = 0.03, (0.001, 0.01)
"""Damping ratios in a test: of modes of rubber alone, and limits of the uneven ones of steel."""
REACH = 4.0
"""Tests are simulated by the modes up to so many times their highest line, with residual vectors."""

NINE = {
    "E_sides": (("MAT1", 1),),
    "E_crosses": (("MAT1", 2),),
    "E_rubber_front": (("MAT1", 4),),
    "E_rubber_rear": (("MAT1", 5),),
    "t_sides": (("PSHELL", 1), ("PSHELL", 2), ("PSHELL", 3), ("PSHELL", 4)),
    "t_cross_front": (("PSHELL", 5), ("PSHELL", 6)),
    "t_cross_middle": (("PSHELL", 7), ("PSHELL", 8)),
    "t_cross_rear": (("PSHELL", 9), ("PSHELL", 10)),
    "t_flanges": (("PSHELL", 11), ("PSHELL", 12)),
}
FIFTEEN = {
    "E_sides": (("MAT1", 1),),
    "E_crosses": (("MAT1", 2),),
    "E_brackets": (("MAT1", 3),),
    "E_rubber_front": (("MAT1", 4),),
    "E_rubber_rear": (("MAT1", 5),),
    "t_sides_lower": (("PSHELL", 1), ("PSHELL", 3)),
    "t_sides_upper": (("PSHELL", 2), ("PSHELL", 4)),
    **{
        f"t_cross_{name}_{half}": (("PSHELL", 5 + 2 * i + j),)
        for i, name in enumerate(("front", "middle", "rear"))
        for j, half in enumerate(("lower", "upper"))
    },
    "t_side_flanges": (("PSHELL", 11),),
    "t_cross_flanges": (("PSHELL", 12),),
}
SETS = {9: NINE, 15: FIFTEEN}


def half_width(name: str) -> float:
    """How far a parameter may go from its value in the deck."""
    return RUBBER if "rubber" in name else STEEL if name.startswith("E") else SHEET


@dataclass(frozen=True)
class State:
    """How the subframe hangs in the laboratory.

    Parameters
    ----------
    loaded : whether each mount carries a mass
    band_hz : what is compared
    """

    name: str
    loaded: bool
    band_hz: tuple[float, float]


@dataclass(frozen=True)
class Measured:
    """Lines and noise of a test.

    Parameters
    ----------
    band_hz, step_hz : of the lines
    relative, floor : σ of real and imaginary part, relative to the magnitude, and to the largest of the FRF
    """

    band_hz: tuple[float, float]
    step_hz: float = 0.5
    relative: float = 0.01
    floor: float = 0.001

    @property
    def lines(self) -> Reals:
        """In Hz."""
        return np.arange(self.band_hz[0], self.band_hz[1] + 1e-9, self.step_hz)


def deviation_sd(test: FrfSet, measured: Measured, band_hz: tuple[float, float]) -> Reals:
    """(outputs, inputs) σ of δ by the noise if the model is right: of the mean of squares of log₁₀(1 + noise/H)."""
    inside = (test.freq_hz >= band_hz[0]) & (test.freq_hz <= band_hz[1])
    size = np.abs(test.values[:, :, inside])
    sd = np.hypot(measured.relative, measured.floor * size.max(axis=2, keepdims=True) / size) / np.log(10.0)
    return np.asarray(np.sqrt((4.0 * sd**4).sum(axis=2)) / inside.sum())


FREE = State("free", False, (100.0, 400.0))
LOADED = State("mass-loaded", True, (40.0, 225.0))


@dataclass(frozen=True, eq=False)
class Laboratory:
    """The model of a subframe, and tests of components of it.

    Parameters
    ----------
    n_dofs : of the mesh
    parameters : 9 or 15
    channels : 47 or 56: triaxial accelerometers and single ones
    exciters : 1 or 2
    common : parameters that all components have alike, those of the first
    """

    n_dofs: int
    parameters: int = 9
    channels: int = 47
    exciters: int = 2
    common: tuple[str, ...] = ()

    @cached_property
    def mesh(self) -> Subframe:
        """The mesh; the deck has no loss factors, as damping is equalised."""
        return subframe(self.n_dofs)

    @cached_property
    def structure(self) -> Structure:
        """As read from its deck."""
        with tempfile.TemporaryDirectory() as folder:
            return build_structure(read_deck(self.write(Path(folder) / "subframe.bdf"))).structure

    def write(self, path: Path) -> Path:
        """The deck without loss factors, which would act besides the equalised damping."""
        bare = tuple(replace(material, GE=0.0) for material in MATERIALS)
        return write_subframe(replace(self.mesh, materials=bare), path)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters."""
        return tuple(SETS[self.parameters])

    @cached_property
    def parameter_set(self) -> ParameterSet:
        """Factors on the deck, with their bounds."""
        made = (Parameter(n, 1.0, 1.0 - half_width(n), 1.0 + half_width(n)) for n in self.names)
        return ParameterSet(tuple(made))

    @property
    def origin(self) -> Reals:
        """The normalised parameters of the deck."""
        return np.zeros(self.parameters)

    @property
    def assignments(self) -> list[Assignment]:
        """What the parameters set."""
        return [
            Assignment(name, FieldRef(card, number, "T" if card == "PSHELL" else "E"))
            for name, entries in SETS[self.parameters].items()
            for card, number in entries
        ]

    @cached_property
    def model(self) -> ParametricModel:
        """Its terms."""
        return parametric_model(self.structure, self.parameter_set, self.assignments)

    @cached_property
    def configured(self) -> Configured:
        """The model in both states, which share its terms."""
        return Configured(self)

    @property
    def inputs(self) -> list[str]:
        """Shakers: one upright on a side member, one across at the other end."""
        first, second = self.mesh.sensors[0], self.mesh.sensors[1]
        return [f"{first}Z+", f"{second}Y+"][: self.exciters]

    @property
    def outputs(self) -> list[str]:
        """Triaxial accelerometers, and single ones for the rest of the channels; those at the inputs are triaxial."""
        triaxial, single = divmod(self.channels, 3)
        at = [f"{node}{axis}+" for node in self.mesh.sensors[:triaxial] for axis in "XYZ"]
        return at + [f"{node}Z+" for node in self.mesh.sensors[triaxial : triaxial + single]]

    def ports(self, state: State) -> Ports:
        """Of all channels."""
        return make_ports(self.configured[state.name], self.inputs, self.outputs)

    def truth(self, component: int) -> Reals:
        """Normalised parameters of a component, drawn from its number alone but for the common ones."""
        first, own = (
            np.random.default_rng([15, i, self.parameters]).uniform(-1.0, 1.0, self.parameters) for i in (0, component)
        )
        chance = np.where([name in self.common for name in self.names], first, own)
        return np.array([SCATTER * half_width(n) for n in self.names]) * chance

    def damping(self, solution: EigenSolution, component: int) -> Reals:
        """Damping ratios of modes: that of rubber by its part of the strain energy, that of steel uneven by mode."""
        point, squares = solution.point, np.maximum(solution.eigenvalues, 1.0)
        rubber = np.zeros(len(squares))
        for i in (i for i, name in enumerate(self.names) if "rubber" in name):
            # the stiffness is linear in a modulus: so much it changes if the modulus doubles
            more = point.configured.at(point.x + (1.0 + point.x) * np.eye(self.parameters)[i]).stiffness
            rubber += np.einsum("ij,ij->j", solution.shapes, (more - point.stiffness) @ solution.shapes) / squares
        low, high = np.log(ZETA_STEEL)
        steel = np.exp(np.random.default_rng([16, component]).uniform(low, high, len(squares)))
        return np.asarray(rubber * ZETA_RUBBER + (1.0 - rubber) * steel)

    def test(self, state: State, component: int, measured: Measured) -> FrfSet:
        """Simulated accelerances of a component."""
        top = REACH * measured.band_hz[1]
        solved = solve_modes(self.configured[state.name].at(self.truth(component)), None, top)
        damping = damping_by_mode(self.damping(solved, component))
        exact = frf(solved, self.ports(state), measured.lines, "accelerance", damping=damping)
        chance = np.random.default_rng([17, component, state.loaded]).standard_normal((2, *exact.values.shape))
        size = np.abs(exact.values)
        noise = np.hypot(measured.relative * size, measured.floor * size.max(axis=2, keepdims=True))
        return replace(exact, values=exact.values + noise * (chance[0] + 1j * chance[1]))

    def write_test(self, path: Path, test: FrfSet) -> Path:
        """A Universal File."""
        return write_uff_frfs(path, ModalTest("subframe", SI, NO_GEOMETRY, frfs=test))


@dataclass(frozen=True, eq=False)
class Configured:
    """The model in a state by its name, made when it is asked for."""

    lab: Laboratory
    made: dict[str, ConfiguredModel] = field(default_factory=dict)

    def __getitem__(self, name: str) -> ConfiguredModel:
        if name not in self.made:
            self.made[name] = configure(self.lab.model, Configuration(name=name, masses=self._masses(name)))
        return self.made[name]

    def _masses(self, name: str) -> tuple[AddedMass, ...]:
        if name == FREE.name:
            return ()
        inertia = tuple(tuple(row) for row in (MOUNT_INERTIA * np.eye(3)).tolist())
        return tuple(AddedMass(node, MOUNT_MASS, inertia=inertia) for node in self.lab.mesh.mounts)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class SettledFrfs(AtFirstState):
    """FRFs whose number of modes follows from the first state of the model."""

    key = FrfResidual.key
    label = FrfResidual.label


def calibration(
    lab: Laboratory, tests: dict[str, FrfSet], ratio: float, sd: float, floor: float = 0.0
) -> UpdateProblem:
    """FRFs with one damping ratio as the only residuals of the states that were tested.

    Parameters
    ----------
    tests : equalised FRFs by the name of the state
    sd, floor : standard deviation of a value, as a part of it and of the largest magnitude of its FRF
    """
    way, scatter = ModelWay(damping=constant_damping(ratio)), FrfScatter(sd, floor)

    def settle(test: FrfSet, state: CaseState) -> Settled:
        highest = float(test.freq_hz[-1])
        fixed = way.settled(state, highest)
        return frf_residual(fixed.model(state, highest), test, scatter=scatter, way=fixed)

    cases = (
        case_without_modes(lab.configured[name], (SettledFrfs(partial(settle, test)),), count=1)
        for name, test in tests.items()
    )
    return UpdateProblem(tuple(cases), lab.parameter_set, scatter="estimated")
