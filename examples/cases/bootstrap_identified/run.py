"""Bootstrap of an identified test with equalised damping against Monte Carlo: python run.py [--quick] [--evidence DIR].

The plane free frame of the bootstrap example, with modal damping between 0.4 and 3 % in the test. Each simulated test
is identified, its damping equalised, and four moduli are calibrated. The standard deviations that a bootstrap of the
measured lines finds in one test are compared with the scatter of the calibrations of many tests, each of them with an
identification of its own. The full form takes about ten minutes of processor time.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np

from femtune.arrays import Reals
from femtune.executor import Processes, Serial
from femtune.identification.kinds import Drawing
from femtune.uncertainty import BootstrapRules, bootstrap_result
from structures.cross_frame import GROUPS, LINES, IdentifiedCampaigns

METHODS: tuple[Drawing, ...] = ("lines", "entries", "noise")


@dataclass(frozen=True)
class Size:
    """Tests of the Monte Carlo, bootstrapped data sets, runs of each, runs checked, largest difference of the means."""

    tests: int
    sets: int
    runs: int
    checked: int
    within: float


QUICK, FULL = Size(5, 1, 10, 1, 0.9), Size(200, 6, 300, 5, 0.15)


def main() -> None:
    """Run the example."""
    options = argparse.ArgumentParser()
    options.add_argument("--quick", action="store_true")
    options.add_argument("--evidence", type=Path)
    asked = options.parse_args()
    # a worker takes longer to start than its few runs
    size, workers = (QUICK, Serial()) if asked.quick else (FULL, Processes())
    campaigns = IdentifiedCampaigns()
    carlo = np.std(workers.run(campaigns, range(1000, 1000 + size.tests), name="test"), axis=0, ddof=1)
    ratios, differences = {}, {}
    calibrated = [campaigns.calibrated(seed) for seed in range(size.sets)]
    for method in METHODS:
        sd = []
        for seed, at in enumerate(calibrated):
            work = replace(at, rules=BootstrapRules(method, size.runs))
            assert work.linear_covariance.size  # computed here, once for all workers
            check = [work.check(i) for i in range(size.checked)] if seed == 0 else []
            found = bootstrap_result(work, workers.run(work, range(size.runs), name="run"), check)
            sd.append(found.samples.std(axis=0, ddof=1))
            if seed == 0:
                differences[method] = found.difference
        ratios[method] = np.array(sd) / carlo
        print(method, ratios[method].mean(axis=0), "difference", differences[method], flush=True)
        assert (np.abs(ratios[method].mean(axis=0) - 1.0) <= size.within).all(), ratios[method]
    page = text(carlo, ratios, differences, size)
    print(page)
    if asked.evidence:
        (asked.evidence / "cases_bootstrap_identified.md").write_text(page, encoding="utf-8")


def text(carlo: Reals, ratios: dict[Drawing, Reals], differences: dict[Drawing, float | None], size: Size) -> str:
    """The page."""
    head = "| parameter | Monte Carlo σ, 1e-5 | " + " | ".join(f"{m}: ratio | single data sets" for m in METHODS) + " |"
    rows = [
        f"| {name} | {1e5 * carlo[i]:.2f} | "
        + " | ".join(
            f"**{ratios[m][:, i].mean():.2f}** | {ratios[m][:, i].min():.2f} to {ratios[m][:, i].max():.2f}"
            for m in METHODS
        )
        + " |"
        for i, name in enumerate(GROUPS)
    ]
    apart = ", ".join(f"{m} {d:.2f} σ" for m, d in differences.items() if d is not None)
    return "\n".join([
        "# Bootstrap of an identified test against Monte Carlo", "",
        "The frame of the [bootstrap example](cases_bootstrap.md) with damping ratios between 0.4 and 3 %, two inputs, "
        f"fourteen outputs and {len(LINES)} lines from 20 to 345 Hz; noise of {100 * IdentifiedCampaigns().floor:g} % "
        "of the largest magnitude of each FRF. Each test is identified, its damping is equalised to 2 %, and four "
        "moduli are calibrated by the equalised FRFs, weighted by a floor of 0.3 %.", "",
        f"**Monte Carlo**: {size.tests} simulated tests, each identified and calibrated anew; the standard "
        f"deviations are known to {100 / np.sqrt(2 * (size.tests - 1)):.0f} %. **Bootstrap**: {size.sets} data sets "
        f"of {size.runs} runs, which draw the measured values again and take one step of the identification.", "",
        head, "| --- " * (2 + 2 * len(METHODS)) + "|", *rows, "",
        f"Required: mean ratios within {100 * size.within:.0f} % of 1. Five runs with another identification, which "
        f"chooses the modes again, differ by at most: {apart}.", "",
    ])  # fmt: skip


if __name__ == "__main__":
    main()
