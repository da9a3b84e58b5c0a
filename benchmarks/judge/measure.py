"""One trial: its data are made, its studies run, and all that the tables may ask of them is kept as one row."""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from decks import STRUCTURES
from trials import EXACT, NOISE, STATED, Deviations, Trial, TrialKind, trial, write_data, write_study

import femtune as ft
from femtune.errors import FemtuneError
from femtune.steps.results import Results
from femtune.study.study import load_study

Row = dict[str, Any]
STARTS = 20
"""Points of the Latin hypercube from which a better minimum is looked for."""
BELIEVED = ("true", "default")
"""Standard deviations that an analyst may state with reason."""
_MOST_KEPT = 5
"""Suspects, and parts of the residuals, that a row keeps."""


def measured(kind: TrialKind, number: int, seed: int, stated: Sequence[str], wrong_every: int = 1) -> Row:
    """The row of a trial.

    Parameters
    ----------
    kind, number, seed : of the trial
    stated : which standard deviations its studies state
    wrong_every : of how many trials of a structure one has wrong standard deviations too; structures take turns
    """
    one, begun, turn = trial(kind, number, seed), time.process_time(), sum(divmod(number, len(STRUCTURES)))
    with tempfile.TemporaryDirectory(prefix="femtune-judge-") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        signal = signal_of(one, Path(folder))
        write_data(one, Path(folder))
        runs = {
            name: run_of(one, Path(folder), STATED[name], name)
            for name in stated
            if name in BELIEVED or not turn % wrong_every
        }
    return {
        "kind": kind, "number": number, "seed": seed, "structure": one.structure.name, "truth": one.truth,
        "fault": None if one.fault is None else [one.fault.field, one.fault.factor], "signal": signal, "runs": runs,
        "seconds": round(time.process_time() - begun, 2),
    }  # fmt: skip


def signal_of(one: Trial, folder: Path) -> float | None:
    """Noncentrality that the error of a wrong model gives χ²: what it leaves of the residuals without noise.

    Linear in the parameters, about their true values, with the deviations of the noise. None for a right model.
    """
    if one.fault is None:
        return None
    write_data(one, folder, EXACT)
    problem = load_study(write_study(one, folder, NOISE, "exact")).problem()
    state = problem.start(np.array([one.truth[field] for field in one.structure.parameters]) - 1.0)
    explained, *_ = np.linalg.lstsq(state.jacobian, state.residuals)
    return float(np.sum((state.residuals - state.jacobian @ explained) ** 2))


def run_of(one: Trial, folder: Path, stated: Deviations, name: str) -> Row:
    """What a study found, by the function that updates, validates and judges; `error` where it ended with one."""
    study = write_study(one, folder, stated, name)
    begun = time.process_time()
    try:
        results = ft.validate(study).results
    except FemtuneError as problem:
        return {"error": problem.code, "seconds": round(time.process_time() - begun, 2)}
    seconds = round(time.process_time() - begun, 2)
    row = facts_of(results, one.truth)
    for parameter, sd in zip(row["parameters"], stated_sd(study, [p["value"] for p in row["parameters"]])):
        parameter["stated_sd"] = sd
    return {**row, "seconds": seconds}


def stated_sd(study: Path, values: Sequence[float]) -> list[float]:
    """Standard deviations of factors by the stated deviations of the data alone, however large the residuals are.

    Parameters
    ----------
    values : of the parameters at the end of the update, in the order of the study
    """
    J = load_study(study).problem().start(np.array(values) - 1.0).jacobian
    return [float(sd) for sd in np.linalg.norm(np.linalg.pinv(J), axis=1)]


def facts_of(results: Results, truth: dict[str, float]) -> Row:
    """Of one run: parameters beside their truth, goodness of fit, the judgement as it is in ``results.json``."""
    update = results.update
    assert update is not None
    parameters = [
        {"true": truth[p.name.replace("_", " ")], "value": p.value, "sd": p.sd, "interval": p.interval_95,
         "at_bound": p.at_bound}
        for p in update.parameters
    ]  # fmt: skip
    goodness, judgement = update.goodness, getattr(results, "judgement", None)
    return {
        "status": update.status, "ok": update.ok, "chi_square": update.chi_square,
        "compared": sum(c.count for c in update.residual_counts), "parameters": parameters,
        "goodness": None if goodness is None else {"p": goodness.p_value, "verdict": goodness.verdict},
        "judgement": None if judgement is None else _short(judgement.model_dump(mode="json")),
    }  # fmt: skip


def _short(judgement: Row) -> Row:
    """A judgement with the first suspects and the largest parts only, which are what the tables use."""
    missing, parts = judgement.get("missing"), judgement.get("parts")
    if missing:
        missing["fields"] = missing["fields"][:_MOST_KEPT]
    if parts:
        for name in ("parts", "neighbours"):
            parts[name] = sorted(parts[name], key=lambda part: part["p_family_wise"])[:_MOST_KEPT]
    return judgement


def from_starts(kind: TrialKind, number: int, seed: int) -> Row:
    """χ² of an update from the nominal values, and the least of several starts over the bounds; true deviations."""
    one, begun = trial(kind, number, seed), time.process_time()
    with tempfile.TemporaryDirectory(prefix="femtune-judge-") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write_data(one, Path(folder))
        study = write_study(one, Path(folder), NOISE, "true")
        nominal, started = _minimum(study, 1), _minimum(study, STARTS)
    return {
        "kind": kind, "number": number, "seed": seed, "structure": one.structure.name, "nominal": nominal,
        "starts": started, "seconds": round(time.process_time() - begun, 2),
    }  # fmt: skip


def _minimum(study: Path, starts: int) -> Row:
    """χ² and the number of residuals at the end of an update; `error` where it ended with one."""
    try:
        found = ft.update(study, update={"starts": starts, "seed": 1}, output=study.with_name(f"starts {starts}"))
    except FemtuneError as problem:
        return {"error": problem.code}
    update = found.results.update
    assert update is not None
    return {"chi_square": update.chi_square, "compared": sum(c.count for c in update.residual_counts)}
