"""The model of a deck as it stands, without the help of a study: what tests compare a study with."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from femtune.fem.structure import Structure
from femtune.files.nastran import build_structure, read_deck
from femtune.model import Configuration, ConfiguredModel, FrequencyTable, configure, parametric_model
from femtune.parameters import ParameterSet
from femtune.testdata import WireFrame


def structure_of(path: Path) -> Structure:
    """The structure of a deck."""
    return build_structure(read_deck(path)).structure


def model_of(
    path: Path, configuration: Configuration | None = None, tables: Iterable[FrequencyTable] = ()
) -> ConfiguredModel:
    """The model of a deck without parameters, in one configuration."""
    model = parametric_model(structure_of(path), ParameterSet(()), (), tables)
    return configure(model, configuration or Configuration())


def frame_at(structure: Structure, nodes: Iterable[int]) -> WireFrame:
    """Test points on grid points of a structure, in ascending order."""
    numbers = sorted(set(nodes))
    return WireFrame(np.array(numbers), np.array([structure.nodes.xyz[structure.nodes.position(n)] for n in numbers]))
