"""The model at a glance: mass, supports, rigid-body check, its first elastic mode."""

from __future__ import annotations

from femtune.report.document import AlertBox, Block, Heading, KeyNumber, KeyNumbers, Paragraph
from femtune.report.numbers import NONE, counted, freq, value, with_unit
from femtune.report.sections.checks import support_words
from femtune.report.source import Source
from femtune.study.results_model import ModelConfiguration, ModelModes

_LOUD = ("problem", "warning")


def model_summary(source: Source) -> list[Block]:
    """Numbers of each configuration, and the warnings of the reader."""
    model = source.results.model
    if model is None:
        return [Paragraph("Not run: the model was not built.")]
    several = len(model.configurations) > 1
    blocks: list[Block] = []
    for c in model.configurations:
        blocks += [Heading(c.configuration)] * several
        blocks.append(KeyNumbers(tuple(_numbers(source, c))))
    return blocks + [AlertBox(n.level, n.code, n.sentence, n.where) for n in model.notices if n.level in _LOUD]


def _numbers(source: Source, c: ModelConfiguration) -> list[KeyNumber]:
    modes = next((m for m in source.results.modes if m.configuration == c.configuration), None)
    units = source.results.study.units.split("-")
    mass_unit = units[1] if len(units) == 3 else ""
    check = c.rigid_body_check
    return [
        KeyNumber(
            "Mass", with_unit(value(c.mass), mass_unit), remark=f"{c.grids} grid points, {c.free_dofs} free DOFs"
        ),
        KeyNumber("Rigid-body check", check.verdict, remark=check.sentence),
        *([_modes(modes)] if modes else []),
        KeyNumber("Supports", support_words(c)[0], remark="; ".join([*_held(c), *c.constraints])),
    ]


def _held(c: ModelConfiguration) -> list[str]:
    """By what the model is held, and what no element stiffens."""
    words, loose = support_words(c)[1], len(c.held_dofs)
    return [*([words] if words else []), *([f"AUTOSPC: {counted(loose, 'DOF')}"] if loose else [])]


def _modes(m: ModelModes) -> KeyNumber:
    elastic = m.freq_hz[m.rigid_body_modes :]
    first = with_unit(freq(elastic[0]), "Hz") if elastic else NONE
    rigid = f", {m.rigid_body_modes} of them rigid-body motions" if m.rigid_body_modes else ""
    return KeyNumber("First elastic mode", first, remark=f"{len(m.freq_hz)} modes solved{rigid}")
