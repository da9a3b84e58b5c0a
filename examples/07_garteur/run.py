"""Compute the modes of the GARTEUR SM-AG19 aeroplane from its mesh: python run.py [--quick] [--evidence DIR].

The computed modes are compared with those of a test. The mesh is not part of this project. It is read from
../shared/data/garteur beside the checkout, or from $FEMTUNE_SHARED_DATA; without it the example reports this and ends.
Decks and pages are written to the folder `run` beside this file.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where structures/ lies

import numpy as np
from deck import deck_text
from measured import compared, expansion_table, identified
from measured import table as compared_table

import femtune as ft
from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import INK, LINE, ORANGE, PALE
from femtune.steps.info.record.model import ModelFacts
from structures.aeroplane_mesh import AeroplaneMesh, read_mesh

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HERE = Path(__file__).resolve().parent
MASS_KG, STRAIN_FREE = 42.858, 1e-8
SPAN_M, LENGTH_M = 2.0, 1.5
TEST_HZ = (6.38, 16.10, 33.12, 33.53, 35.65, 48.38, 49.43, 55.08)
"""Frequencies of one laboratory's test, for the eye: the nominal model is not updated here."""


@dataclass(frozen=True)
class Aeroplane:
    """One state of the aeroplane: deck and page, what femtune says of it, and its natural frequencies."""

    name: str
    deck: Path
    page: Path
    facts: ModelFacts
    freq_hz: tuple[float, ...]

    @property
    def elastic_hz(self) -> tuple[float, ...]:
        """Without the rigid-body modes."""
        return tuple(f for f in self.freq_hz if f > 1e-3 * self.freq_hz[-1])


def aeroplane(folder: Path, mesh_file: Path, clamped: bool) -> Aeroplane:
    """Write the deck, solve it, and write a page with a picture of each mode."""
    name = "clamped" if clamped else "free"
    deck = folder / f"garteur_{name}.bdf"
    deck.write_text(deck_text(read_mesh(mesh_file), clamped))
    page = deck.with_suffix(".html")
    found = ft.modes(deck, report=page).results
    assert found.model is not None
    return Aeroplane(name, deck, page, found.model, found.modes[0].freq_hz)


def check(state: Aeroplane) -> None:
    """Mass, and the number and freedom from strain of the rigid motions."""
    (facts,) = state.facts.configurations
    assert abs(facts.mass - MASS_KG) < 1e-3, facts.mass
    rigid = len(state.freq_hz) - len(state.elastic_hz)
    assert rigid == (0 if state.name == "clamped" else 6), (state.name, rigid)
    if state.name == "free":
        worst = max(facts.rigid_body_check.relative_energies)
        assert worst < STRAIN_FREE, worst


def geometry(mesh: AeroplaneMesh, sensors: AeroplaneMesh) -> str:
    """The mesh in the axes of the test's picture, from above at an angle, with the places of the sensors."""
    points = np.array(list(mesh.nodes.values()))
    width = np.ptp(points, axis=0)
    # the wing span and the length of the fuselage
    assert abs(np.sort(width)[-1] - SPAN_M) < 0.05, width
    assert abs(np.sort(width)[-2] - LENGTH_M) < 0.1, width
    view = np.array([[-0.55, 0.83, 0.0], [-0.42, -0.28, 0.86]])

    def draw(sheet: Figure) -> None:
        axes = sheet.subplots()
        for shell in mesh.shells.values():
            corners = np.array([mesh.nodes[n] for n in (*shell, shell[0])]) @ view.T
            axes.fill(*corners.T, facecolor=PALE, edgecolor=LINE, linewidth=0.4)
        at = np.array(list(sensors.nodes.values())) @ view.T
        axes.plot(*at.T, "o", color=ORANGE, markersize=3)
        for number, place in zip(sensors.nodes, at):
            axes.annotate(str(number), place, (2, 2), textcoords="offset points", fontsize=6, color=INK)
        axes.set_aspect("equal")
        axes.set_axis_off()

    return draw_svg(6.6, 4.2, draw)


def table(states: list[Aeroplane]) -> str:
    """Elastic modes of both states, and those of a test for the eye."""
    free, clamped = (s.elastic_hz for s in states)
    rows = []
    for i in range(min(len(free), len(clamped))):
        test = f"{TEST_HZ[i]:.2f}" if i < len(TEST_HZ) else ""
        rows.append(f"| {i + 1} | {free[i]:.4f} | {test} | {clamped[i]:.4f} |")
    head = "| mode | free, Hz | one laboratory's test, Hz | clamped at node 58, Hz |\n|---|---|---|---|"
    return "\n".join([head, *rows])


def main() -> None:
    """Both decks, their modes, and a page with pictures of each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the same as the full form, which takes seconds")
    parser.add_argument("--evidence", type=Path, help="folder for the table of the documentation")
    arguments = parser.parse_args()
    beside = Path(__file__).resolve().parents[3] / "shared" / "data"
    mesh_file = Path(os.environ.get("FEMTUNE_SHARED_DATA", beside)) / "garteur" / "shell_mesh.mail"
    if not mesh_file.is_file():
        print(f"skipped: the mesh is not here ({mesh_file})")
        return
    folder = HERE / "run"
    folder.mkdir(exist_ok=True)
    states = [aeroplane(folder, mesh_file, clamped) for clamped in (False, True)]
    for state in states:
        check(state)
    picture = geometry(read_mesh(mesh_file), read_mesh(mesh_file.parent / "sensors.mail"))
    found = identified(folder, mesh_file.parent)
    correlation = compared(folder, states[0].deck)
    (facts,) = states[0].facts.configurations
    worst = max(facts.rigid_body_check.relative_energies)
    text = "\n".join(
        [
            "# The GARTEUR aeroplane: shells, links and masses\n",
            f"Mass {facts.mass:.4f} kg ({MASS_KG} kg stated). The six rigid-body motions of the free aeroplane are "
            f"free of strain: relative strain energy at most {worst:.1e}. Twenty modes per configuration; "
            "rigid-body modes are not listed.\n",
            table(states),
            "\n![Geometry and places of the sensors](07_garteur.svg)\n",
            f"Wing span {SPAN_M:g} m and length {LENGTH_M:g} m as stated; the points are the sensors.",
            "\n## Comparison with the modes of its measured FRFs\n",
            "24 accelerances of a test of 1995, identified without manual selection: nine elastic modes up to 65 "
            "Hz, all of them paired by shape. No parameter is updated.\n",
            compared_table(found, correlation),
            "\n## Expansion of the measured shapes\n",
            "Error at sensors that are left out and predicted from the others, relative to the shape. The mesh is not "
            "updated, so that errors of the model are part of it.\n",
            expansion_table(correlation),
        ]
    )
    print(text)
    if arguments.evidence:
        (arguments.evidence / "07_garteur.md").write_text(text + "\n")
        (arguments.evidence / "07_garteur.svg").write_text(picture, encoding="utf-8")
    for state in states:
        print(f"deck: {state.deck}\npage: {state.page}")


if __name__ == "__main__":
    main()
