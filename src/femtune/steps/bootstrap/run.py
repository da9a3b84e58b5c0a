"""The step bootstrap: spread of the updated parameters, from the FRFs of one test."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.errors import FemtuneError, Notice
from femtune.executor import Serial, finish
from femtune.journal.finished import FinishedRuns
from femtune.journal.run_files import BOOTSTRAP_FILE
from femtune.model import digest
from femtune.model.full_model import direct
from femtune.steps.bootstrap.facts import bootstrap_results
from femtune.steps.run_folder import unwritable
from femtune.study.error_places import errors_at
from femtune.study.executor import executor_of
from femtune.study.study import solved_by
from femtune.uncertainty import BootstrapRules, BootstrapRun, bootstrap_of, bootstrap_result
from femtune.uncertainty.bootstrap import drawn_groups

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from femtune.executor import Executor
    from femtune.residuals import Evaluation
    from femtune.steps.bootstrap.record import BootstrapResults
    from femtune.study.progress import Progress
    from femtune.study.study import Study
    from femtune.uncertainty import Bootstrap
    from femtune.updating import ReducedSearch, UpdateResult


def check_bootstrap(study: Study, at: Evaluation) -> None:
    """Check, before the update, that there is something to draw from.

    Raises
    ------
    FemtuneError : ``bootstrap.stages``, ``bootstrap.no-lines``, ``bootstrap.few-lines``
    """
    table = study.file.bootstrap
    assert table is not None
    with errors_at(study.file.where("bootstrap")):
        if study.file.stage:
            raise FemtuneError("bootstrap.stages")
        if table.method != "noise":
            drawn_groups(at.weighted, table.method)


def bootstrap_at(
    study: Study,
    found: UpdateResult,
    folder: Path,
    arrays: dict[str, NDArray[Any]],
    progress: Progress,
    search: ReducedSearch | None = None,
) -> BootstrapResults:
    """The runs about the result of the update; each is on disk as soon as it has ended, and is not made twice.

    Parameters
    ----------
    search : reduced models that hold the full ones' modes and responses at the result; the runs are made on them where
        they serve all FRFs

    Raises
    ------
    FemtuneError : ``bootstrap.*``, ``executor.*``, ``run.unwritable``
    """
    table = study.file.bootstrap
    assert table is not None
    with errors_at(study.file.where("bootstrap")):
        if not found.status.ok:
            raise FemtuneError("bootstrap.not-converged", status=found.status.value)
        rules = BootstrapRules(
            table.method, table.runs, table.seed, table.jacobian, table.tolerance,
            checked=min(table.checked, table.runs),
        )  # fmt: skip
        reduced = search if search is not None and search.serves_all else None
        # what the journal keeps of a run is its end, not its solutions
        problem = solved_by(study, direct).problem() if reduced is None else reduced.reduced_problem()
        at = found.after if reduced is None else problem.start(found.x)
        work = bootstrap_of(problem, at, found.side, found.active, rules, misfit(found))
    executor = executor_of(study, reduced=reduced is not None)
    begun = time.monotonic()
    runs, again, remarks = _runs(work, executor, FinishedRuns(folder / BOOTSTRAP_FILE, _key(work)), study, progress)
    check = Serial().run(work.check, range(rules.checked if rules.jacobian == "shared" else 0), name="bootstrap run")
    result = bootstrap_result(work, runs, check)
    seconds = time.monotonic() - begun
    orders = () if reduced is None else tuple(trained.model.order for trained in reduced.trained)
    return bootstrap_results(result, arrays, executor.words, seconds, again, remarks, orders)


def misfit(result: UpdateResult) -> float:
    """Root mean square of the residuals in their stated standard deviations, over their degrees of freedom."""
    r = result.after.residuals
    return float(np.sqrt(r @ r / max(len(r) - len(result.active), 1)))


def _runs(
    work: Bootstrap, executor: Executor, file: FinishedRuns, study: Study, progress: Progress
) -> tuple[list[BootstrapRun], int, tuple[Notice, ...]]:
    """All runs, how many of them are of an earlier run, and what happened to workers."""
    count, remarks = work.rules.runs, list[Notice]()
    try:
        known = _known(file.begin(study.file.study.journal), count, len(work.at.x))
    except OSError as error:
        raise unwritable(file.path.parent, error) from error
    done = len(known)
    progress.step("bootstrap runs that have ended", done, count)

    def keep(number: int, run: BootstrapRun) -> None:
        nonlocal done
        try:
            # kept before it is shown: whoever shows it may be interrupted
            file.add(_line(number, run))
        except OSError as error:
            raise unwritable(file.path.parent, error) from error
        done += 1
        progress.step("bootstrap runs that have ended", done, count)

    runs = finish(executor, work, range(count), known, name="bootstrap run", finished=keep, remark=remarks.append)
    return runs, len(known), tuple(remarks)


def _key(work: Bootstrap) -> str:
    """Of all that a run depends on, but for their number."""
    rules, at = work.rules, work.at
    lower, upper = work.problem.parameters.bounds
    facts = (rules.method, rules.seed, rules.jacobian, rules.tolerance, rules.most_steps, work.size)
    measured = [test.measured.values for test in work.identified]
    return digest(*facts, *measured, at.x, at.residuals, at.jacobian, lower, upper, *work.side.rows(at.x), work.moving)


def _line(number: int, run: BootstrapRun) -> dict[str, object]:
    return {
        "run": number, "x": run.x.tolist(), "converged": run.converged, "steps": run.steps,
        "solutions": run.solutions, "own": run.own, "problem": run.problem,
    }  # fmt: skip


def _known(lines: Sequence[Mapping[str, Any]], count: int, k: int) -> dict[int, BootstrapRun]:
    """Runs by their number; what cannot be read is made again."""
    runs = {}
    for line in lines:
        try:
            x = np.array(line["x"], float)
            run = BootstrapRun(
                x, bool(line["converged"]), int(line["steps"]), int(line["solutions"]), bool(line["own"]),
                str(line["problem"]),
            )  # fmt: skip
            number = int(line["run"])
        except (ValueError, KeyError, TypeError):
            continue
        if x.shape == (k,) and np.isfinite(x).all() and 0 <= number < count:
            runs[number] = run
    return runs
