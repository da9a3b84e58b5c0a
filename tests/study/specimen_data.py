"""Three beams of one drawing: simulated modes of each, free and with an added mass."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from tests.deck_models import frame_at, structure_of

from femtune.dofs import DofSet
from femtune.fem.fields import FieldRef
from femtune.files.uff import write_uff_frfs, write_uff_modes
from femtune.modal import ModeSet
from femtune.model import AddedMass, Assignment, Configuration, configure, parametric_model, solve_modes
from femtune.model.response import frf, make_ports
from femtune.parameters import Parameter, ParameterSet
from femtune.testdata import ModalTest
from femtune.units import SI

from .cantilever import CANTILEVER, LABELS, bounded
from .damped_cantilever import DAMPED

TRUTH = {"A": 0.9, "B": 1.0, "C": 1.15}
TIP = 1.1
SD = 1e-3
MASS = 3.0
_COUNT = 5


def write_tests(folder: Path, seed: int | None = 1, states: tuple[str, ...] = ("free",), tip: float = TIP) -> None:
    """Deck and tests; frequencies with relative noise of `SD`, without a seed exact. Specimen C has `tip` too."""
    (folder / "beam.bdf").write_text(CANTILEVER)
    structure = structure_of(folder / "beam.bdf")
    rng = None if seed is None else np.random.default_rng(seed)
    dofs = DofSet.parse(LABELS)
    rows = [structure.nodes.dof(d.node, d.component) for d in dofs]
    frame = frame_at(structure, (d.node for d in dofs))
    for name, root in TRUTH.items():
        own = ParameterSet((Parameter("root", root), Parameter("tip", tip if name == "C" else TIP)))
        fields = [Assignment("root", FieldRef("PBAR", 1, "I1")), Assignment("tip", FieldRef("PBAR", 2, "I1"))]
        model = parametric_model(structure, own, fields)
        for state in states:
            masses = (AddedMass(3, MASS),) if state == "loaded" else ()
            configured = configure(model, Configuration(state, masses=masses))
            solution = solve_modes(configured.at(np.zeros(2)), _COUNT)
            noise = 0.0 if rng is None else SD * rng.standard_normal(_COUNT)
            freq = np.asarray(solution.freq_hz[:_COUNT] * (1.0 + noise))
            shapes = (configured.transformation @ solution.shapes)[rows][:, :_COUNT]
            test = ModalTest(name, SI, frame, modes=ModeSet(freq, shapes, dofs))
            write_uff_modes(folder / f"{name}_{state}.uff", test)


def write_frfs(folder: Path, noise: float = 0.01) -> None:
    """Deck and tests of FRFs without modes: two outputs, one input, with noise relative to each value."""
    (folder / "beam.bdf").write_text(DAMPED)
    structure = structure_of(folder / "beam.bdf")
    rng, lines = np.random.default_rng(3), np.arange(8.0, 260.0, 1.0)
    frame = frame_at(structure, (3, 5))
    for name, root in TRUTH.items():
        own = ParameterSet((Parameter("root", root), Parameter("tip", TIP)))
        fields = [Assignment("root", FieldRef("PBAR", 1, "I1")), Assignment("tip", FieldRef("PBAR", 2, "I1"))]
        configured = configure(parametric_model(structure, own, fields), Configuration())
        exact = frf(solve_modes(configured.at(np.zeros(2)), 12), make_ports(configured, ["5Y+"], ["3Y+", "5Y+"]), lines)
        chance = rng.standard_normal((2, *exact.values.shape))
        values = exact.values * (1.0 + noise * (chance[0] + 1j * chance[1]))
        write_uff_frfs(folder / f"{name}_free.uff", ModalTest(name, SI, frame, frfs=replace(exact, values=values)))


def study_text(states: tuple[str, ...] = ("free",), more: str = "", individual: tuple[str, ...] = ("root",)) -> str:
    """The study of all specimens."""
    configurations = "".join(
        f'[[configuration]]\nname = "{name} {state}"\nspecimen = "{name}"\ntest = "{name}_{state}.uff"\n'
        + (f"masses = [{{ node = 3, mass = {MASS} }}]\n" if state == "loaded" else "")
        for name in TRUTH
        for state in states
    )
    parameters = "".join(
        bounded(name, f"PBAR {i} I1") + ("individual = true\n" if name in individual else "")
        for i, name in enumerate(("root", "tip"), 1)
    )
    return (
        f'[study]\ntitle = "Three beams"\ndeck = "beam.bdf"\nunits = "m-kg-s"\njournal = false\n'
        f"[modes]\ncount = 6\n[residuals]\nfrequency_sd = {SD}\n{configurations}{parameters}{more}"
    )
