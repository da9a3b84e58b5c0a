"""Measure the convergence of the bar element to exact beams: python run.py [--quick] [--evidence DIR].

Relative errors of the first three elastic modes with 16 and 32 elements, and the order of convergence between them.
Asserts the theoretical orders.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where structures/ lies

import numpy as np

from structures.beams import SUPPORTS, Support, bending_errors, orders

_ROUNDING = 3e-8


def expected_order(support: Support, consistent: bool, shear: bool) -> float:
    """Two with shear flexibility; four for Euler beams, but two for lumped mass where an end can turn and move."""
    return 2.0 if shear or ("free" in support and not consistent) else 4.0


def row(support: Support, consistent: bool, shear: bool) -> str:
    """One line of the table; asserts the order."""
    errors = bending_errors(support, 1, consistent, shear, shear)
    clear = np.abs(errors[-1]) > _ROUNDING
    found = orders(errors)
    wanted = expected_order(support, consistent, shear)
    assert np.abs(found[clear] - wanted).max() < 0.3, (support, consistent, shear, found)
    cells = [f"{100 * e:.1e} (order {o:.2f})" if c else f"{100 * e:.1e}" for e, o, c in zip(errors[-1], found, clear)]
    beam = "Timoshenko" if shear else "Euler"
    mass = "consistent" if consistent else "lumped"
    return f"| {beam} | {support[0]}-{support[1]} | {mass} | {' | '.join(cells)} | {wanted:.0f} |"


def main() -> None:
    """All supports, both kinds of mass, with and without shear flexibility."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the same as the full form, which takes seconds")
    parser.add_argument("--evidence", type=Path, help="folder for the table of the documentation")
    arguments = parser.parse_args()
    cases = [(s, c, t) for t in (False, True) for s in SUPPORTS for c in (False, True)]
    text = "\n".join(
        [
            "# Beams: convergence to exact frequencies\n",
            "Error in % with 32 elements and measured order of convergence (from 16 to 32 elements; not given if "
            "the error is at the level of rounding), bending in plane 1. Timoshenko beams include rotary inertia.\n",
            "| beam | boundary conditions | mass | mode 1 | mode 2 | mode 3 | theoretical order |",
            "|---|---|---|---|---|---|---|",
            *(row(*case) for case in cases),
        ]
    )
    print(text)
    if arguments.evidence:
        (arguments.evidence / "04_element_convergence.md").write_text(text + "\n")


if __name__ == "__main__":
    main()
