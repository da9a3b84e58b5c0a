"""Compare shells with closed-form, Ritz and published solutions: python run.py [--quick] [--evidence DIR].

Every table asserts its errors and the theoretical orders of convergence. The NAFEMS tables require the folder
../shared/data beside the checkout (or $FEMTUNE_SHARED_DATA), the modes of the twisted beam require CalculiX. If one of
these is missing, the page states this.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where structures/ lies

from curved import curved
from locking import locking
from nafems import nafems
from other_plates import other_plates
from square_plates import square_plates
from statics import statics
from stiffened import stiffened
from twisted import twisted_modes

SECTIONS = (square_plates, other_plates, curved, twisted_modes, statics, stiffened, nafems, locking)
TITLE = "# Shells: closed-form solutions, published tests and measured orders of convergence\n"


def main() -> None:
    """All tables, one after the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="coarser meshes and fewer cases; the bounds scale with them"
    )
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    arguments = parser.parse_args()
    pages = [TITLE]
    for section in SECTIONS:
        begin = perf_counter()
        pages.append(section(arguments.quick))
        print(f"{pages[-1]}\n({section.__name__}: {perf_counter() - begin:.1f} s)\n", flush=True)
    if arguments.evidence:
        (arguments.evidence / "05_shell_benchmarks.md").write_text("\n".join(pages))


if __name__ == "__main__":
    main()
