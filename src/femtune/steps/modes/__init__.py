"""Natural modes, their shapes and files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from femtune.steps.step import (
    EIGENSOLVER,
    FILE,
    FRESH,
    JSON,
    SCATTER,
    Command,
    InRun,
    Page,
    ReportSection,
    Step,
    study_of,
)

_SCATTER = ("frequency_scatter", "shape_scatter", "seed", "units")


def _asked(options: dict[str, Any], path: Path) -> dict[str, Any]:
    """The options that describe a simulated test become one."""
    sensors, uff = options.pop("sensors"), options.pop("uff")
    scatter = {key: options.pop(key) for key in _SCATTER}
    if sensors and uff is None:
        raise click.UsageError("--sensor requires --uff, the file to write")
    if uff is None:
        return {**options, "simulate": None}
    # mistakes of the study are reported before numpy is imported
    study_of(path)
    from femtune.steps.modes.simulated_test import SimulatedTest  # noqa: PLC0415

    return {**options, "simulate": SimulatedTest(uff, sensors, **scatter)}


STEP = Step(
    "modes",
    tables=("modes",),
    in_run=(InRun("file for ParaView", "modes.in_run:write_vtu", 100, optional="file for ParaView"),),
    command=Command(
        group="Model",
        help=(
            "Compute the natural frequencies and modes of each configuration.\n\n"
            "PATH is a study file (.toml) or a Nastran deck."
        ),
        params=(
            click.Argument(["path"], type=FILE),
            click.Option(
                ["--report", "page"], type=FILE, metavar="PAGE", help="Write an HTML page with a picture of each mode."
            ),
            click.Option(["--count"], type=int, help="Number of modes, instead of that of the study or deck."),
            click.Option(
                ["--max-hz"], type=float, metavar="HZ", help="All modes up to this frequency, instead of --count."
            ),
            click.Option(
                ["--uff"], type=FILE, metavar="FILE", help="Write the modes as a simulated test (Universal File, 55)."
            ),
            click.Option(
                ["--vtu"], type=FILE, metavar="FILE", help="Write mesh, shapes and parameters for ParaView (.vtu)."
            ),
            click.Option(
                ["--sensor", "sensors"], multiple=True, metavar="12Z+", help='For --uff; or "101 THRU 160:123".'
            ),
            click.Option(
                ["--units"], metavar="m-kg-s", help="Units, if a deck is given instead of a study; for --uff."
            ),
            click.Option(
                ["--frequency-scatter"],
                type=SCATTER,
                default=0.0,
                metavar="PART",
                help="For --uff: relative standard deviation of the frequencies, 0.002 is 0.2 %.",
            ),
            click.Option(
                ["--shape-scatter"],
                type=SCATTER,
                default=0.0,
                metavar="PART",
                help="For --uff: standard deviation relative to the largest entry.",
            ),
            click.Option(
                ["--seed"],
                type=click.IntRange(min=0),
                default=1,
                show_default=True,
                help="For --uff: seed of the simulated noise.",
            ),
            EIGENSOLVER,
            FRESH,
            JSON,
        ),
        asked=_asked,
        data=lambda result: result.records,
        shown=lambda result: (result.records,),
        document="modes.page.frequencies:modes_document",
    ),
    sections=(
        ReportSection(
            "modes",
            "Modes before and after",
            "modes.page.modes:modes",
            intro=(
                "Frequency errors are (model − test)/test. MAC is the modal assurance criterion between the "
                "measured and the computed shape; identical shapes have a MAC of 1."
            ),
            place=30,
        ),
        ReportSection(
            "mode_shapes",
            "Mode shapes",
            "modes.page.mode_shapes:mode_shapes",
            intro=(
                "The paired modes of the updated model are shown in a parallel projection. If an updated deck "
                "was written, the model has the values of that deck. Grey: undeformed structure. Blue: mode "
                "shape of the model; shells are darker where they move more. Orange: measured shape at the "
                "sensors, scaled to the model by the modal scale factor; measured rotations also move the "
                "points that rigid elements (dashed) connect to the sensor's grid point. Directions that were "
                "not measured are drawn without motion."
            ),
            optional=True,
            place=40,
        ),
    ),
    page=Page(
        record="modes",
        genre="Natural modes",
        verdict="modes.page.modes:sturm_verdict",
        sections=(
            ReportSection("model_summary", "Model", "run.page.summary:model_summary"),
            ReportSection("natural_modes", "Natural modes", "modes.page.modes:natural_modes"),
            ReportSection(
                "pictures",
                "Mode shapes",
                "modes.page.mode_shapes:pictures",
                intro=(
                    "The structure is shown in a parallel projection, with the z axis of the basic coordinate "
                    "system pointing upwards. The pale drawing is the undeformed structure. Shells are coloured "
                    "by their displacement relative to the largest displacement of the mode; bars and rigid "
                    "elements (dashed) are drawn as lines. The largest displacement is drawn as 12 % of the "
                    "structure's diagonal. Rigid-body modes are arbitrary combinations of the unconstrained "
                    "rigid-body motions."
                ),
            ),
            ReportSection("checks", "Model checks", "info.page:checks"),
            ReportSection("provenance", "Provenance", "run.page.method:provenance"),
        ),
    ),
)
