"""How often the places of test points are found on 200 random layouts: python run.py [--each N] [--evidence DIR].

Each of five meshes has layouts in the axes of the model, shifted, rotated, and with left-handed axes; half of the
changed ones are in another unit. Mode shapes are not used: coordinates alone decide.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from pathlib import Path

from layouts import CHANGES, MESHES, OUTCOMES, layout, outcome

PAGE = "benchmark_sensors.md"


def main() -> None:
    """Run all layouts and write the page."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--each", type=int, default=10, help="layouts of each mesh and change")
    options.add_argument("--evidence", type=Path, help="folder of the page")
    asked = options.parse_args()
    counts: Counter[tuple[str, str]] = Counter()
    total: Counter[str] = Counter()
    begun = time.process_time()
    for i, mesh in enumerate(MESHES):
        for j, change in enumerate(CHANGES):
            for k in range(asked.each):
                seed = 10_000 * i + 1000 * j + k
                found = outcome(layout(mesh, change, seed))
                counts[mesh, found] += 1
                counts[change, found] += 1
                total[found] += 1
                if found in ("wrong", "refused"):
                    print(f"{mesh}, {change}, seed {seed}: {found}", flush=True)
        print(mesh, {name: counts[mesh, name] for name in OUTCOMES}, flush=True)
    number = sum(total.values())
    seconds = (time.process_time() - begun) / number
    text = _page(counts, total, number, seconds)
    print(text)
    if asked.evidence:
        (asked.evidence / PAGE).write_text(text, encoding="utf-8")


def _page(counts: Counter[tuple[str, str]], total: Counter[str], number: int, seconds: float) -> str:
    right = total["right"] + total["right, symmetry told"]
    lines = [
        "# Sensors on a mesh: random layouts",
        "",
        f"Written by `make bench-sensors`: {number} layouts of 15 to 40 points on five meshes. Each point is a grid",
        "point, moved by at most 0.3 of the distance to the neighbouring grid point; up to 20 % of the points have no",
        "partner. The layouts are in the axes of the model, shifted, rotated, or rotated with left-handed axes, and",
        "half of the changed ones are in another unit of length. Half of all have numbers that are those of other grid",
        "points. Coordinates alone decide; mode shapes are not used.",
        "",
        f"**{right} of {number} ({100.0 * right / number:.1f} %) are right, {total['wrong']} wrong without a word**;",
        f"{seconds:.1f} s of processor time each.",
        "",
        "An assignment is right if nine in ten of the points with a partner have it, none has another one, and no",
        "point without partner is assigned. *Symmetry told*: right up to a symmetry of the mesh, and `init` says that",
        "there are other motions. *Several told*: the motion that was written is not the right one, and `init` says",
        "that it is not unique. *Refused*: no motion was found.",
        "",
        "| layouts | " + " | ".join(OUTCOMES) + " |",
        "| --- |" + " ---: |" * len(OUTCOMES),
    ]
    rows = [*MESHES, *CHANGES]
    lines += [f"| {row} | " + " | ".join(str(counts[row, name]) for name in OUTCOMES) + " |" for row in rows]
    lines += [f"| all | {' | '.join(str(total[name]) for name in OUTCOMES)} |", ""]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
