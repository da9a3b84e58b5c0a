"""Section of the report: stages of a bottom-up study, their initial values, changes and misfits."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from femtune.document.document import Cell, Figure, Heading, Listing, Paragraph, Table, columns, row
from femtune.document.figures.bars import error_sums_svg
from femtune.document.numbers import NONE, counted, listed, short, value
from femtune.steps.update.page.starts import reduced_models

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.steps.update.record.stages import StageErrorSum, StageResults, StageRun

_MOST_VALUES = 60
"""Parameters up to which their values by stage are a table: a longer one is not read."""
_NOTE = (
    "σ includes the uncertainty of the parameters that were fixed in the stage; σ of the data excludes it. Misfit: "
    "residuals relative to what noise and these parameters explain; it is about 1 for a correct model."
)
_SEEDS = "The first run starts from the results of earlier stages, the others from the seeds of the study."


def stages(stages: tuple[StageResults, ...]) -> list[Block]:
    """Table of all stages, then runs, error sums and left-out modes of each; nothing without stages."""
    if not stages:
        return []
    details = (block for stage in stages for block in _details(stage))
    return [Heading("Stages"), _table(stages), *_by_hand(stages), *_values(stages), *details]


def _table(stages: tuple[StageResults, ...]) -> Block:
    heads = columns(
        "Stage", "Configurations", "Compared", "Parameter", ">Before", ">After", ">± σ", ">σ of the data", ">Misfit",
        "End",
    )  # fmt: skip
    rows = [cells for stage in stages for cells in _rows(stage)]
    return Table("Stages", heads, tuple(rows), _NOTE)


def _rows(stage: StageResults) -> list[tuple[Cell, ...]]:
    compared = f"{listed(stage.kinds)} ({stage.comparisons}){_band(stage)}"
    misfit = ", ".join(short(m.size) for m in stage.misfit)
    large = any(m.larger_than_noise for m in stage.misfit)
    out = []
    for i, p in enumerate(stage.parameters):
        first = i == 0
        out.append(
            row(
                stage.name if first else "",
                ", ".join(stage.configurations) if first else "",
                compared if first else "",
                p.name,
                value(p.before),
                value(p.value),
                short(p.sd),
                short(p.sd_of_data),
                Cell(misfit if first else "", tone="poor" if large else ""),
                Cell(stage.message.split(":")[0] if first else "", tone="" if stage.ok else "poor"),
            )
        )
    return out


def _band(stage: StageResults) -> str:
    if stage.band_hz is None:
        return ""
    low, high = stage.band_hz
    return f", {short(low)} to {short(high)} Hz" if high is not None else f", from {short(low)} Hz"


def _by_hand(stages: tuple[StageResults, ...]) -> list[Block]:
    """Values that the study set between stages."""
    rows = tuple(
        row(stage.name, v.parameter, value(v.before), value(v.value), short(v.sd), v.reason)
        for stage in stages
        for v in stage.by_hand
    )
    heads = columns("Stage", "Parameter", ">Before", ">Set to", ">± σ", "Reason")
    return [Table("Values set by hand", heads, rows, "Set before the stage begins.")] if rows else []


def _values(stages: tuple[StageResults, ...]) -> list[Block]:
    """All free parameters through the stages."""
    updated = [p.name for stage in stages for p in stage.parameters]
    names = list(dict.fromkeys([*updated, *(p.name for stage in stages for p in stage.fixed)]))
    if len(stages) == 1 or not 0 < len(names) <= _MOST_VALUES:
        return []
    heads = columns("Parameter", *(f">{stage.name}" for stage in stages))
    rows = tuple((Cell(name), *(_value_in(stage, name) for stage in stages)) for name in names)
    note = "Values at the end of each stage, with ± σ for those that it updated; grey: fixed in the stage."
    return [Table("Parameters in the stages", heads, rows, note)]


def _value_in(stage: StageResults, name: str) -> Cell:
    for p in stage.parameters:
        if p.name == name:
            return Cell(f"{value(p.value)} ± {short(p.sd)}")
    by_hand = " (by hand)" if any(v.parameter == name for v in stage.by_hand) else ""
    known = next((p.value for p in stage.fixed if p.name == name), None)
    return Cell(f"{value(known)}{by_hand}", tone="" if by_hand else "muted")


def _details(stage: StageResults) -> list[Block]:
    blocks: list[Block] = []
    if len(stage.runs) > 1:
        blocks += [_runs(stage)]
    if len(stage.error_sums) > 1:
        blocks += [_figure(stage, kind) for kind in dict.fromkeys(s.kind for s in stage.error_sums)]
    if stage.left_out:
        items = tuple(f"{m.configuration}, mode {m.label}: {m.reason}" for m in stage.left_out)
        blocks += [Paragraph(f"{stage.name}: modes that were not compared", "muted"), Listing(items)]
    return [*blocks, *reduced_models(stage.reduction, f"{stage.name}: ")]


def _runs(stage: StageResults) -> Block:
    agree = sum(run.agrees for run in stage.runs)
    heads = columns("Start", *(f">{p.name}" for p in stage.parameters), ">½ rᵀr", ">Steps", "End")
    rows = tuple(row(*_run(run)) for run in stage.runs)
    note = f"{agree} of {counted(len(stage.runs), 'run')} reached the same optimum. {_SEEDS}"
    return Table(f"{stage.name}: several initial points", heads, rows, note)


def _run(run: StageRun) -> list[str | Cell]:
    ends = [f"{value(a)} → {value(b)}" for a, b in zip(run.start, run.values)]
    start = f"seed {run.seed}" if run.seed else "earlier stages"
    objective = short(run.objective) if run.objective is not None else NONE
    end = "same optimum" if run.agrees else run.message
    return [start, *ends, objective, str(run.iterations), Cell(end, tone="" if run.agrees else "poor")]


def _figure(stage: StageResults, kind: str) -> Block:
    sums = [s for s in stage.error_sums if s.kind == kind]
    before, after = sum(s.before for s in sums), sum(s.after for s in sums)
    draw = partial(
        error_sums_svg, [_label(s, stage) for s in sums], [s.before for s in sums], [s.after for s in sums],
        f"{stage.name}: {kind}",
    )  # fmt: skip
    caption = f"{stage.name}: error sums of {kind} residuals before and after the stage, by mode and in total."
    alt = f"Sum of {kind} errors from {short(before)} to {short(after)} in {counted(len(sums), 'pair')} of bars"
    return Figure(draw, caption, alt)


def _label(entry: StageErrorSum, stage: StageResults) -> str:
    return entry.label if len(stage.configurations) == 1 else f"{entry.configuration} {entry.label}"
