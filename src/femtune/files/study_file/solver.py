"""[solver]: a model that is a command line with templates, which gives out modes and nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field

from femtune.errors import FemtuneError
from femtune.files.formats import ModesFormatKey
from femtune.files.study_file.kinds import (
    Command,
    Fraction,
    NotNegative,
    Positive,
    SolverFileName,
    SolverResultName,
    TemplateName,
    Text,
    TomlTable,
)
from femtune.files.study_file.source import StudyLines, table, tables
from femtune.runs.kinds import KeptFolders


class SolverTable(TomlTable):
    """[solver]: command, input and output files, and when a run is tried again."""

    command: Command
    """Program and arguments, as a list or a line; started without a shell in the folder of the run. Example: `"ccx
    beam"`"""
    templates: tuple[TemplateName, ...] = ()
    """Input files with [placeholders](guide/external-solvers.md#templates); required, unless the solver reads the
    `deck` of `[study]`. Example: `["beam.inp"]`"""
    deck_name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}$")] = "model.bdf"
    """Name of the deck in the folder of a run. Example: `"beam.bdf"`"""
    files: tuple[SolverFileName, ...] = ()
    """Further files that are copied into the folder of each run. Example: `["mesh.inc"]`"""
    result: SolverResultName
    """The file that is read, in the folder of the run. Example: `"beam.frd"`"""
    format: ModesFormatKey
    """Format of the file that is read: `"abaqus-dat"`, `"ansys-rst"`, `"calculix-dat"`, `"calculix-frd"`,
    `"nastran-f06"`, `"nastran-op2"`, `"nastran-punch"` or `"table"`. Example: `"calculix-frd"`"""
    timeout_s: Positive = 3600.0
    """Time after which a run is ended, s. Example: `600.0`"""
    retries: Annotated[int, Field(ge=0, le=100)] = 1
    """How often a run that failed is tried again. Example: `3`"""
    error_texts: tuple[Text, ...] = ()
    """Texts in the output of a failed run, in addition to those of the format. Example: `["SEVERE"]`"""
    licence_texts: tuple[Text, ...] = ()
    """Texts in the output where no licence was free. Example: `["all licenses are in use"]`"""
    licence_wait_s: NotNegative = 60.0
    """Pause before a licence is requested again, s. Example: `300.0`"""
    licence_tries: Annotated[int, Field(ge=1, le=100_000)] = 60
    """How often a licence is requested. Example: `500`"""
    environment: dict[str, str] = Field(default_factory=dict)
    """Environment variables of the solver. Example: `{ OMP_NUM_THREADS = "1" }`"""
    version: str = ""
    """Version of the solver, in words; runs of another version are not used. Example: `"2.20"`"""
    keep: KeptFolders = "failed"
    """Folders of runs that are kept: `"none"`, `"failed"` or `"all"`. Example: `"all"`"""
    keep_most: Annotated[int, Field(ge=0, le=1_000_000)] = 20
    """With `keep = "failed"`: number of folders of failed runs that are kept, the newest. Example: `200`"""
    mass: Positive | None = None
    """Mass that the output must state. Example: `12.5`"""
    mass_tolerance: Fraction = 0.01
    """Largest relative difference allowed between `mass` and the mass in the output. Example: `1e-4`"""
    step: Annotated[float, Field(gt=0, le=0.5)] | None = None
    """Distance of the runs for the differences, relative to half the range of the bounds. Default: chosen from the
    noise. Example: `0.05`"""
    repeat_tolerance: Fraction = 1e-6
    """Relative difference allowed between the frequencies of two runs with the same input. Example: `1e-4`"""
    moves: Annotated[int, Field(ge=1, le=1000)] = 20
    """How often the update may run the solver around another point. Example: `50`"""
    derivatives: Literal["differences", "deck"] = "differences"
    """`"differences"` of runs of the solver; or `"deck"`: where steps are large, derivatives come from femtune's own
    model of the `deck`, whose `fields` each parameter names; templates may be the input of the solver beside it
    ([guide](guide/external-solvers.md#a-study-with-a-solver)). Example: `"deck"`"""


Data = dict[str, Any]


def solver_rules(data: Data, source: StudyLines) -> Iterator[FemtuneError]:
    """A solver excludes a table of runs, and needs a number of modes and free parameters only."""
    if "solver" not in data:
        return
    if "runs" in data:
        yield source.error(("runs",), "external.study/runs", {})
    yield from _inputs(data, source)
    if "count" not in table(data, "modes"):
        yield source.error(("solver",), "external.study/count", {})
    for place, entry in tables(data, "parameter"):
        if "tie" in entry:
            yield source.error((*place, "tie"), "external.study/tie", {}, name=entry.get("name"))
    update = table(data, "update")
    for key in ("starts", "first", "hops"):
        if key in update:
            yield source.error(("update", key), "external.study/update", {}, key=key)
    if "stage" in data:
        yield source.error(("stage",), "external.study/update", {}, key="[[stage]]")


def _inputs(data: Data, source: StudyLines) -> Iterator[FemtuneError]:
    """Every configuration needs a deck or templates, its own or those of [solver]."""
    solver = table(data, "solver")
    deck = table(data, "study").get("deck")
    derivatives = solver.get("derivatives", "differences")
    by_deck = derivatives == "deck"
    for place, entry in list(tables(data, "configuration")) or [((), {})]:
        overrides = table(entry, "solver")
        at = (*place, "solver") if overrides else ("solver",)
        templates, known = bool(overrides.get("templates", solver.get("templates"))), bool(overrides.get("deck", deck))
        if by_deck and not known:
            yield source.error(at, "external.study/no-deck", {})
        elif templates == known and not (templates and derivatives != "differences"):
            yield source.error(at, "external.study/input", {})
    if by_deck:
        for place, entry in tables(data, "parameter"):
            if not entry.get("fields"):
                yield source.error(place, "external.study/fields", {}, name=entry.get("name"))
