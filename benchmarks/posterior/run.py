"""How often intervals of the posterior hold beside a wrong model: python benchmarks/posterior/run.py [--each N].

Four small structures are updated with noisy tests of structures whose values are known: with a right model, with wrong
masses, wrong stiffnesses, something that the deck does not have, and with a parameter that is not free. The standard
deviations of the noise are as stated. Each finished test is written at once, so that an interrupted run goes on where
it ended; --minutes ends it, --evidence writes the page.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "judge"))

import numpy as np
from decks import AEROPLANE, FRAME, PLATE, WELDED, Structure, kind_of
from rates import Rate, rate
from series import Row, run_series
from trials import FURTHER_MODES, STATED, UNITS, Fault, Trial, trial, write_data, write_study

import femtune as ft
from femtune.errors import FemtuneError
from femtune.steps.posterior.record import PosteriorResults

STRUCTURES = (FRAME, PLATE, WELDED, AEROPLANE)
CASES = {
    "right": "right model",
    "masses": "masses and densities ±5 %",
    "stiffnesses": "stiffnesses ±10 %",
    "hidden": "something that the deck lacks",
    "left out": "a parameter left out, 10 to 40 % off",
}
"""What is wrong with the model, and its title."""
TARGETS = {"right": (92.0, 97.0), "masses": (91.0, None), "stiffnesses": (91.0, None), "hidden": (91.0, None),
           "left out": (82.0, None)}  # fmt: skip
WIDEST = 1.25
"""Aim of the width of right models over that of errors of the data alone."""
MASS_ERROR, STIFFNESS_ERROR = 0.05, 0.10
SMALLEST_LEFT_OUT, LARGEST_LEFT_OUT = 0.10, 0.40
ASKED = {"noise": "stated", "draws": 300, "starts": 0}
WAYS = ("posterior", "errors of the data alone", "update")
WAYS_OF_PREDICTION = ("posterior", "errors of the data alone")


def wrong_values(case: str, structure: Structure, rng: np.random.Generator) -> dict[str, float]:
    """Factors on values of the deck that no parameter represents."""
    fixed = [f for f in structure.values if f not in structure.parameters]
    heavy = [f for f in fixed if kind_of(f) in ("mass", "density")] if case == "masses" else []
    stiff = [f for f in fixed if kind_of(f) not in ("mass", "density")] if case == "stiffnesses" else []
    return {f: float(np.exp(MASS_ERROR * rng.standard_normal())) for f in heavy} | {
        f: float(np.exp(STIFFNESS_ERROR * rng.standard_normal())) for f in stiff
    }


def made(case: str, number: int, seed: int, folder: Path) -> tuple[Trial, Path]:
    """The data and the study of a test."""
    structure = STRUCTURES[number % len(STRUCTURES)]
    rng = np.random.default_rng([seed, list(CASES).index(case), number])
    one = trial("right", 0, seed)
    truth = {field: 1.0 + 0.12 * float(rng.uniform(-1.0, 1.0)) for field in structure.parameters}
    one = replace(one, number=number, structure=structure, truth=truth, seed=int(rng.integers(1, 2**31)))
    if case == "hidden":
        hidden = structure.hidden[number // len(STRUCTURES) % len(structure.hidden)]
        size = float(np.exp(rng.uniform(np.log(hidden.smallest), np.log(hidden.largest))))
        one = replace(one, fault=Fault(hidden.key, size))
    if case == "left out":
        field = structure.parameters[number // len(STRUCTURES) % len(structure.parameters)]
        size = 1.0 + float(rng.uniform(SMALLEST_LEFT_OUT, LARGEST_LEFT_OUT))
        truth[field] = size if rng.integers(2) else 1.0 / size
        rest = tuple(f for f in structure.parameters if f != field)
        structure = replace(structure, parameters=rest)
    write_data(replace(one, truth=truth | wrong_values(case, one.structure, rng)), folder)
    one = replace(one, structure=structure, truth=truth)
    return one, write_study(one, folder, STATED["true"], "posterior")


def measured(case: str, number: int, seed: int) -> Row:
    """Of each parameter whether the intervals hold, and their widths over that of errors of the data alone."""
    row: Row = {"case": case, "number": number, "seed": seed}
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        one, study = made(case, number, seed, Path(folder))
        row["structure"] = one.structure.name
        begun = time.process_time()
        try:
            results = ft.posterior(study, posterior=ASKED, update={"look_further": False}).results
        except FemtuneError as error:
            return row | {"refused": error.code}
        seconds = time.process_time() - begun
        found = results.posterior
        if found is None:
            return row | {"refused": "; ".join(a.code for a in results.alerts)}
        row["predicted"] = predicted(one, study, found)
    row |= {
        "seconds": round(seconds, 1),
        "effective": round(found.effective),
        "hits": {w: [] for w in WAYS},
    }
    for p in found.parameters:
        true = one.truth[p.parameter.replace("_", " ")]
        for way, interval in zip(WAYS, (p.interval_95, p.of_data_interval_95 or p.interval_95, p.update_interval_95)):
            if interval is not None:
                row["hits"][way].append(bool(interval[0] <= true <= interval[1]))
    row["apart"] = [c.what for c in found.model_errors if c.count == 1]
    row["wider"] = [round(p.sd / (p.of_data_sd or p.sd), 3) for p in found.parameters]
    return row


def predicted(one: Trial, study: Path, found: PosteriorResults) -> dict[str, dict[str, list[bool]]]:
    """Whether intervals of predicted frequencies have the true ones: of modes in the test, and of five more."""
    count = one.structure.rigid + one.structure.modes + FURTHER_MODES
    true = np.ravel(ft.modes(study.parent / "true.bdf", units=UNITS, count=count).freq_hz)
    alone = ft.posterior(study, posterior=ASKED | {"discrepancy": "none"}, update={"look_further": False})
    out: dict[str, dict[str, list[bool]]] = {}
    for way, record in zip(WAYS_OF_PREDICTION, (found, alone.results.posterior)):
        out[way] = {"used": [], "not used": []}
        for f in () if record is None else record.frequencies:
            if f.mode <= len(true):
                low, high = f.interval_95
                out[way]["used" if f.used else "not used"].append(bool(low <= true[f.mode - 1] <= high))
    return out


def page(rows: Sequence[Row], seed: int) -> Iterator[str]:
    """Lines of the table."""
    done = [r for r in rows if "hits" in r]
    yield "# Intervals beside a wrong model"
    yield ""
    yield f"Parts of the 95 % intervals that contain the true value, over {len(done)} simulated tests of a frame, a"
    yield f"plate, a welded shell and an aeroplane, whose noise is as stated (seed {seed}). The posterior has errors of"
    yield "the model as by default. Errors of the data alone are of the same samples, or of the residuals linearised at"
    yield "the result of the update where the posterior is about changes of the model. The update has the intervals of"
    yield "`femtune update`, which are widened by the misfit. Intervals of Clopper and Pearson in brackets. Made by"
    yield "`benchmarks/posterior/run.py`."
    yield ""
    yield f"| model | tests | aim | {' | '.join(WAYS)} | width over that of the data alone, median |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: | ---: |"
    for case, title in CASES.items():
        mine = [r for r in done if r["case"] == case]
        low, high = TARGETS[case]
        aim = f"≥ {low:g} %" if high is None else f"{low:g} to {high:g} %"
        wider = [w for r in mine for w in r["wider"]]
        width = f"{np.median(wider):.2f}" if wider else "–"
        cells = [_cell(rate(h for r in mine for h in r["hits"][way])) for way in WAYS]
        width += f" (aim {WIDEST})" if case == "right" else ""
        yield f"| {title} | {len(mine)} | {aim} | {' | '.join(cells)} | {width} |"
    yield from _predictions(done)
    yield ""
    seconds = [r["seconds"] for r in done]
    if seconds:
        yield f"A posterior took {np.median(seconds):.0f} s of processor time in the median, {max(seconds):.0f} s at"
        yield "most."
    refused = [r for r in rows if "refused" in r]
    if refused:
        codes = ", ".join(sorted({r["refused"] for r in refused}))
        yield f"{len(refused)} tests have no posterior: {codes}."


def _predictions(done: Sequence[Row]) -> Iterator[str]:
    """Lines of the table of frequencies."""
    yield ""
    yield "Natural frequencies of the structure in the 95 % intervals that are predicted for them: of the modes in the"
    yield "test, and of up to five above them, which nothing measured. The true one is that with the same number."
    yield ""
    heads = [f"{kind}: {way}" for kind in ("modes in the test", "modes not measured") for way in WAYS_OF_PREDICTION]
    yield f"| model | {' | '.join(heads)} |"
    yield "| --- | ---: | ---: | ---: | ---: |"
    for case, title in CASES.items():
        mine = [r["predicted"] for r in done if r["case"] == case]
        cells = [
            _cell(rate(hit for r in mine for hit in r[way][kind]))
            for kind in ("used", "not used")
            for way in WAYS_OF_PREDICTION
        ]
        yield f"| {title} | {' | '.join(cells)} |"


def _cell(found: Rate) -> str:
    low, high = found.interval
    return f"{100 * found.share:.1f} % ({100 * low:.0f} to {100 * high:.0f})" if found.of else "–"


def main() -> None:
    """Run what the journal does not have, and write the page."""
    run_series(__doc__, "posterior", "case", tuple(CASES), 400, measured, page)


if __name__ == "__main__":
    main()
