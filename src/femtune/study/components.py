"""Components of a study: their elements, and configurations of some of them alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.errors import ErrorCollector, FemtuneError
from femtune.model import Configuration, configure
from femtune.model.reduce import Alone, Components, alone
from femtune.study.error_places import errors_at, place_of
from femtune.study.parameters import elements_of

if TYPE_CHECKING:
    from femtune.files.built_model import BuiltModel
    from femtune.files.study_file import ConfigurationEntry, StudyFile
    from femtune.model import ConfiguredModel, ParametricModel


def components_of(file: StudyFile, built: BuiltModel) -> Components | None:
    """The components of a study; None if it has none.

    Raises
    ------
    FemtuneError : ``parameter.region``, ``reduce.component-empty``, ``reduce.components-overlap``; several together
    """
    if not file.component:
        return None
    errors, elements = ErrorCollector(), {}
    for i, entry in enumerate(file.component):
        with errors.catch():
            chosen = elements_of(file, ("component", i), entry, built, f"component {entry.name}")
            elements[entry.name] = chosen or frozenset()
    errors.raise_if_any()
    limits = {entry.name: entry.max_hz for entry in file.component if entry.max_hz is not None}
    with errors_at(file.where("component")):
        return Components(elements, limits)


def whole_structure(model: ParametricModel) -> ConfiguredModel:
    """The structure of the deck with all its elements, from which interfaces are found."""
    return configure(model, Configuration())


def present_components(
    file: StudyFile, entry: ConfigurationEntry, whole: ConfiguredModel, components: Components
) -> Alone:
    """What is absent in a configuration that lists components, and what its interface holds.

    Raises
    ------
    FemtuneError : ``study.component/all``, ``study.component/no-interface``
    """
    assert entry.components is not None
    present = alone(whole, components, entry.components)
    if not present.elements_off:
        raise FemtuneError("study.component/all", where=place_of(file, entry, "components"), configuration=entry.name)
    if entry.interface == "free":
        return Alone(present.elements_off, ())
    if not present.interface:
        raise FemtuneError(
            "study.component/no-interface", where=place_of(file, entry, "interface"), configuration=entry.name
        )
    return present
