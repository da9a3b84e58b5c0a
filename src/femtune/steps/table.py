"""A table of several results: one line each."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from csv import DictWriter
from pathlib import Path
from typing import Any

from femtune.arguments import checked
from femtune.errors import FemtuneError, Where
from femtune.files.whole_file import write_whole
from femtune.steps.run.result import RunResult
from femtune.study.rows import Rows

_OF_CASE = ("case", "status", "error_before_percent", "error_after_percent")
"""Columns beside those of the parameters."""


@checked
def table(results: Any, csv: Path | str | None = None) -> Rows:
    """One line for each of several updates, such as those of a loop over tests or settings.

    Parameters
    ----------
    results : results of `update`, `run` or `validate` in a list, or by a name or a value; other keys are shown as text
    csv : CSV file to write, with the same columns

    Returns
    -------
    Rows with `case` (the key, or the number from 1), `status`, the weighted mean error in % before and after the
    update, and of each parameter its value and its standard deviation (``E``, ``E_sd``); None where a result lacks it.
    The column of a parameter that is named as another column is followed by ``_value``: ``status_value``

    Raises
    ------
    FemtuneError : ``call.argument`` for something else than results, ``run.unwritable``

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> root = ft.Parameter("root", fields=["PBAR 1 I1"], lower=0.5, upper=2.0)
    >>> found = {
    ...     sd: ft.update(
    ...         ft.read_deck(example_deck(), units="m-kg-s"), example_test(), modes={"count": 5}, parameters=[root],
    ...         residuals=[ft.FrequencyResidual(sd=sd)], output=f"sd_{sd}",
    ...     )
    ...     for sd in (0.01, 0.02)
    ... }
    >>> ft.table(found).columns
    ('case', 'status', 'error_before_percent', 'error_after_percent', 'root', 'root_sd')
    """
    if not isinstance(results, Mapping | Sequence) or isinstance(results, str):
        raise _no_result("results", results)
    named = list(results.items() if isinstance(results, Mapping) else enumerate(results, start=1))
    for case, result in named:
        if not isinstance(result, RunResult):
            raise _no_result(f"results[{_plain(case)!r}]", result)
    names = list(dict.fromkeys(row["name"] for _, result in named for row in result.parameters))
    columns = _columns(names)
    rows = Rows.of(_line(case, result, columns) for case, result in named)
    if csv is not None:
        _write(Path(csv), rows)
    return rows


def _no_result(name: str, given: Any) -> FemtuneError:
    allowed = "results of update, run or validate" if name == "results" else "a result of update, run or validate"
    return FemtuneError("call.argument", name=name, function="table", allowed=allowed, given=type(given).__name__)


def _plain(case: Any) -> Any:
    return case if isinstance(case, int | float | str) else str(case)


def _columns(names: list[str]) -> dict[str, str]:
    """The column of each parameter; a name that is that of another column is followed by ``_value``."""
    taken, columns = set(_OF_CASE), {}
    for name in names:
        column = name
        while column in taken or f"{column}_sd" in taken or (column != name and column in names):
            column += "_value"
        columns[name] = column
        taken |= {column, f"{column}_sd"}
    return columns


def _line(case: Any, result: RunResult, columns: Mapping[str, str]) -> dict[str, Any]:
    history = result.history
    line = {
        "case": _plain(case),
        "status": result.status,
        "error_before_percent": history[0]["objective_percent"] if history else None,
        "error_after_percent": history[-1]["objective_percent"] if history else None,
    }
    known = {row["name"]: row for row in result.parameters}
    for name, column in columns.items():
        row = known.get(name)
        line[column], line[f"{column}_sd"] = (None, None) if row is None else (row["value"], row["sd"])
    return line


def _write(path: Path, rows: Rows) -> None:
    text = io.StringIO(newline="")
    writer = DictWriter(text, rows.columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    try:
        write_whole(path, text.getvalue().encode())
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FemtuneError("run.unwritable/table", where=Where(str(path)), reason=reason) from error
