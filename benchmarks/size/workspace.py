"""The folder of one case at one size: its deck, and the matrices that all other ways are given."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cases import CASES, Case, changed, compiled, write_case
from femtune.files.nastran import build_structure, read_deck
from femtune.model import Configuration, ConfiguredModel, configure
from femtune.model.linear.symmetric import SymmetricMatrix


@dataclass(frozen=True)
class Workspace:
    """Files of one case at one size."""

    folder: Path

    @property
    def deck(self) -> Path:
        """The Nastran deck."""
        return self.folder / "model.bdf"

    @property
    def facts(self) -> dict[str, Any]:
        """Case, size and number of equations."""
        found = json.loads((self.folder / "facts.json").read_text())
        assert isinstance(found, dict)
        return found

    @property
    def is_ready(self) -> bool:
        """True where all files were written; the facts come last."""
        return (self.folder / "facts.json").exists()

    @property
    def case(self) -> Case:
        """What is measured."""
        return CASES[self.facts["case"]]

    def matrices(self, point: int) -> tuple[SymmetricMatrix, SymmetricMatrix]:
        """K and M at the nominal (0) or the changed (1) parameters."""
        starts, columns = self._load("indptr"), self._load("indices")
        K, M = (SymmetricMatrix(self._load(f"{name}{point}"), columns, starts) for name in "KM")
        return K, M

    def full_matrices(self, point: int) -> tuple[sp.csr_array, sp.csr_array]:
        """The same with both triangles, as SciPy wants them."""
        K, M = self.matrices(point)
        return K.full(), M.full()

    def _load(self, name: str) -> NDArray:
        return np.asarray(np.load(self.folder / f"{name}.npy", allow_pickle=False))


def configured_model(case: Case, deck: Path) -> ConfiguredModel:
    """From the deck to matrices on free DOFs."""
    return configure(compiled(case, build_structure(read_deck(deck)).structure), Configuration())


def prepare(case: Case, size: int, folder: Path) -> None:
    """Write the deck and the matrices."""
    space = Workspace(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_case(case, size, space.deck)
    model = configured_model(case, space.deck)
    np.save(folder / "indptr.npy", model.indptr)
    np.save(folder / "indices.npy", model.indices)
    n_parameters = len(case.parameters())
    for i, x in enumerate((np.zeros(n_parameters), changed(n_parameters))):
        point = model.at(x)
        np.save(folder / f"K{i}.npy", point.symmetric_stiffness.data)
        np.save(folder / f"M{i}.npy", point.symmetric_mass.data)
    facts = {"case": case.name, "size": size, "equations": model.n_free, "entries": len(model.indices)}
    (folder / "facts.json").write_text(json.dumps(facts))
