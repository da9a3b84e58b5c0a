"""From the measured functions of the aeroplane to its modes, and these beside the deck's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import femtune as ft
from femtune.files.uff import read_uff, write_uff_modes
from femtune.identification import IdentifiedModes, InputKnown, Rule, identify_frfs
from femtune.steps.correlate.record.correlation import CorrelationResults
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI
from structures.aeroplane_mesh import read_mesh

ELASTIC, COMPLEX = 9, 0.9
"""A tenth pole of the functions, at 9 Hz, has a phase collinearity of 0.88: no mode of the aeroplane."""

STUDY = """[study]
title = "GARTEUR aeroplane: measured functions beside the mesh as it is"
deck = "{deck}"
units = "m-kg-s"

[modes]
count = 20

[test]
file = "identified.uff"

[sensors]
tolerance = 0.2          # the mesh is a middle surface; sensors sit on tips and drums beside its nodes

[correlate]
expand = "mdre"
"""


def identified(folder: Path, data: Path) -> IdentifiedModes:
    """Modes of the functions, written as a test with the places of its sensors."""
    frfs = read_uff(data / "frf_1995.unv", units=SI, file_units=SI).test.frfs
    assert frfs is not None
    found = identify_frfs(frfs, InputKnown(rule=Rule(collinearity=COMPLEX)))
    places = read_mesh(data / "sensors.mail")
    frame = WireFrame(
        np.array(list(places.nodes)), np.array(list(places.nodes.values())), lines=tuple(places.links.values())
    )
    # the format holds frequencies, damping and shapes
    modes = replace(
        found.modes, freq_sd_hz=None, shapes_sd=None, damping_sd=None, covariance=None, modal_a=None, source="test"
    )
    write_uff_modes(folder / "identified.uff", ModalTest("GARTEUR", SI, frame, modes=modes))
    return found


def compared(folder: Path, deck: Path) -> CorrelationResults:
    """The identified modes beside those of the deck."""
    study = folder / "measured.toml"
    study.write_text(STUDY.format(deck=deck.name), encoding="utf-8")
    (found,) = ft.correlate(study)
    assert [p.test_label for p in found.pairs] == [str(i + 1) for i in range(ELASTIC)], found.pairs
    macs = [p.mac for p in found.pairs]
    assert min(macs) > 0.65, macs
    # the errors of a coarse model that was not updated prove nothing about the program: they are listed, not asserted
    of_dynamic, of_mdre = (np.mean(errors_of(found, method)) for method in ("dynamic", "mdre"))
    # the dynamic expansion passes errors of the model on where sensors are few
    assert of_mdre < 0.6 * of_dynamic, (of_mdre, of_dynamic)
    return found


def errors_of(correlation: CorrelationResults, method: str) -> list[float]:
    """Errors in % at sensors that are left out, of all modes."""
    assert correlation.expansion is not None
    errors = [e for mode in correlation.expansion.modes for e in mode.errors if e.method == method]
    return [float("nan") if e.error_percent is None else e.error_percent for e in errors]


def expansion_table(correlation: CorrelationResults) -> str:
    """Errors of the expansion methods at sensors that are left out."""
    assert correlation.expansion is not None
    labels = [mode.test_label for mode in correlation.expansion.modes]
    columns = [errors_of(correlation, method) for method in ("serep", "dynamic", "mdre")]
    rows = [f"| {label} | {' | '.join(f'{e:.1f}' for e in errors)} |" for label, *errors in zip(labels, *columns)]
    return "\n".join(["| mode | SEREP, % | dynamic, % | MDRE, % |\n|---|---|---|---|", *rows])


def table(found: IdentifiedModes, correlation: CorrelationResults) -> str:
    """Identified modes with their partners."""
    assert found.modes.damping_ratio is not None
    rows = [
        f"| {p.test_label} | {p.test_freq_hz:.3f} | {100 * ratio:.2f} | {p.model_freq_hz:.3f} | "
        f"{p.freq_error_percent:+.2f} | {p.mac:.3f} |"
        for p, ratio in zip(correlation.pairs, found.modes.damping_ratio)
    ]
    head = "| mode | test, Hz | damping, % | mesh as it is, Hz | error, % | MAC |\n|---|---|---|---|---|---|"
    return "\n".join([head, *rows])
