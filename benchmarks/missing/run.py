"""Is a wrong property found that is no parameter? Wrong and right models of a frame and a plate, updated and tested.

    python benchmarks/missing/run.py [--models 100] [--structure frame|plate|both] [--stated …] [--out …]

In a wrong model one field that is no parameter has another value in the structure than in the deck, by a random factor
inside its usual errors; in a right one only the parameters have. All of it is seeded.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.stats import beta

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))

from femtune.steps.judge.facts.missing import missing_fields
from femtune.steps.judge.finished_update import FinishedUpdate
from femtune.steps.results import Results
from femtune.study.described import source_of
from femtune.study.progress import silent
from femtune.study.study import load_study
from femtune.study.update_method import method_of
from femtune.updating import update
from structures.wrong_property import FRAME, PLATE, WrongProperty

NOISE = (0.003, 0.02)
"""Standard deviations of the frequencies, relative, and of the shapes."""
STATED = {"true": NOISE, "default": (0.005, 0.03), "small": (0.001, 0.0067), "large": (0.009, 0.06)}
"""Those that the studies state."""
HARMFUL = 3.0
"""Standard deviations by which a parameter misses the truth in a harmful model."""


@dataclass(frozen=True)
class Trial:
    """One model.

    Parameters
    ----------
    place : of the culprit among the groups of fields, from 1, its look-alikes counted with it; 0 if it is not there
    named : the same for the culprit itself, not only for what looks like it
    p : least adjusted p value; 1 if nothing was tested
    """

    structure: str
    culprit: str
    factor: float
    status: str
    harmful: bool
    place: int = 0
    named: int = 0
    sign: bool = False
    p: float = 1.0
    p_refit: float = 1.0
    factor_found: float = 0.0
    seconds: float = 0.0
    seconds_update: float = 0.0
    iterations: int = 0


def trial(structure: WrongProperty, wrong: bool, stated: tuple[float, float], seed: int, folder: Path) -> Trial:
    """Draw a model, update it and test it."""
    random = np.random.default_rng(seed)
    others = [name for name in structure.fields if name not in structure.parameters]
    culprit = str(random.choice(others)) if wrong else ""
    factors = {
        name: float(np.exp(structure.fields[name][1] * random.uniform(-1.0, 1.0))) for name in structure.parameters
    }
    if wrong:
        size = structure.fields[culprit][1]
        factors[culprit] = float(np.exp(random.choice([-1.0, 1.0]) * size * random.uniform(0.5, 1.5)))
    study = load_study(source_of(structure.study(folder, factors, NOISE, stated, seed)))
    problem = study.problem()
    begun = time.process_time()
    initial = problem.start(np.zeros(len(problem.parameters.free)))
    result = update(problem, method_of(study.file.update, study.parameters), start=initial)
    took = time.process_time() - begun
    truth = [factors[name] for name in structure.parameters]
    values, sd = list(result.values.values()), list(result.sd.values())
    harmful = any(s > 0.0 and abs(v - t) > HARMFUL * s for v, t, s in zip(values, truth, sd))
    facts = {
        "structure": structure.name, "culprit": culprit, "factor": factors.get(culprit, 1.0),
        "status": result.status.name, "harmful": bool(harmful), "seconds_update": took,
        "iterations": len(result.history) - 1,
    }  # fmt: skip
    begun = time.process_time()
    results = Results.model_construct()
    found = missing_fields(FinishedUpdate(study, initial, result, results, {}, silent))
    facts["seconds"] = time.process_time() - begun
    if found.p_value is None:
        return Trial(**facts)
    place = next((i for i, f in enumerate(found.fields, 1) if culprit in (f.name, *f.alike)), 0) if wrong else 0
    named = next((i for i, f in enumerate(found.fields, 1) if culprit == f.name), 0) if wrong else 0
    first = found.fields[0]
    right = bool(place) and found.fields[place - 1].name == culprit
    refit = first.refit
    return Trial(
        **facts, place=place, named=named, p=found.p_value,
        sign=right and found.fields[place - 1].increase == (factors[culprit] > 1.0),
        p_refit=1.0 if refit is None or refit.p_value is None else refit.p_value,
        factor_found=0.0 if refit is None else refit.factor,
    )  # fmt: skip


def rate(hits: int, count: int) -> Mapping[str, float]:
    """A rate in per cent with its 95 % binomial interval (Clopper and Pearson)."""
    low = beta.ppf(0.025, hits, count - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, count - hits) if hits < count else 1.0
    return {"percent": 100.0 * hits / max(count, 1), "low": 100.0 * low, "high": 100.0 * high, "of": count}


def summary(trials: list[Trial]) -> Mapping[str, Mapping[str, float]]:
    """Rates over wrong and right models."""
    ok = [t for t in trials if t.status.startswith("CONVERGED")]
    wrong, right = [t for t in ok if t.culprit], [t for t in ok if not t.culprit]
    harmful = [t for t in wrong if t.harmful]
    found = [t for t in harmful if t.p < 0.05]
    named = [t for t in found if t.named]
    return {
        "right, p < 0.05": rate(sum(t.p < 0.05 for t in right), len(right)),
        "right, p < 0.01": rate(sum(t.p < 0.01 for t in right), len(right)),
        "harmful, p < 0.05": rate(len(found), len(harmful)),
        "harmful, p < 0.01 and refit p < 0.01": rate(
            sum(t.p < 0.01 and t.p_refit < 0.01 for t in harmful), len(harmful)
        ),
        "harmful, culprit or look-alike first": rate(sum(t.place == 1 for t in found), len(found)),
        "harmful, culprit or look-alike in first three": rate(sum(1 <= t.place <= 3 for t in found), len(found)),
        "harmful, culprit itself first": rate(sum(t.named == 1 for t in found), len(found)),
        "harmful, culprit itself in first three": rate(sum(1 <= t.named <= 3 for t in found), len(found)),
        "sign right where named": rate(sum(t.sign for t in named), len(named)),
    }


def main() -> None:
    """Run all models of both structures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", type=int, default=100, help="wrong models, and as many right ones")
    parser.add_argument("--structure", choices=("frame", "plate", "both"), default="both")
    parser.add_argument("--stated", choices=STATED, default="true", help="standard deviations that the studies state")
    parser.add_argument("--out", type=Path, default=None, help="file for all trials and rates")
    asked = parser.parse_args()
    trials, chosen = [], {"frame": (FRAME,), "plate": (PLATE,), "both": (FRAME, PLATE)}[asked.structure]
    with tempfile.TemporaryDirectory() as folder:
        for i in range(2 * asked.models):
            structure = chosen[i // 2 % len(chosen)]
            trials.append(trial(structure, i % 2 == 0, STATED[asked.stated], 1000 + i, Path(folder) / "model"))
            print(trials[-1], flush=True)
    rates = summary(trials)
    for name, found in rates.items():
        print(f"{name:48} {found['percent']:5.1f} % ({found['low']:.1f} … {found['high']:.1f}) of {found['of']}")
    seconds, whole = np.median([t.seconds for t in trials if not t.culprit]), np.median([t.seconds for t in trials])
    each = np.median([t.seconds_update / max(t.iterations, 1) for t in trials])
    print(f"processor time: test {seconds:.2f} s, with refits {whole:.2f} s, one iteration {each:.2f} s (medians)")
    if asked.out is not None:
        asked.out.write_text(json.dumps({"rates": rates, "trials": [asdict(t) for t in trials]}, indent=1))


if __name__ == "__main__":
    main()
