"""The commands, each with its options, the step that it runs and how the result is printed.

What they do is in the library; it is imported when a command runs, so that help is quick.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from femtune import __version__
from femtune.cli import output as out
from femtune.cli.guard import GuardedGroup
from femtune.cli.running import identification_of, load, run_step, study_of
from femtune.errors import codes, did_you_mean, explanation, printable

# ----------------------------------------------------------------------------------------------------
# The option --eigensolver: for one command it takes the place of the environment variable.


_VARIABLE = "FEMTUNE_EIGENSOLVER"


def choose_eigensolver(context: click.Context, option: click.Parameter, name: str | None) -> None:
    """Set the variable that the model reads until the command ends."""
    if name is not None:
        context.with_resource(_set(name))


@contextmanager
def _set(name: str) -> Iterator[None]:
    before = os.environ.get(_VARIABLE)
    os.environ[_VARIABLE] = name
    try:
        yield
    finally:
        if before is None:
            del os.environ[_VARIABLE]
        else:
            os.environ[_VARIABLE] = before


_FILE = click.Path(path_type=Path)
_SCATTER = click.FloatRange(min=0.0, max=1.0)

_study = click.argument("study", type=_FILE)
_quiet = click.option("--quiet", is_flag=True, help="No progress, and no tables.")
_json = click.option("--json", "as_json", is_flag=True, help="The result as JSON on standard output.")
_output = click.option("--output", type=_FILE, metavar="FOLDER", help="Run folder instead of that of the study.")
_fresh = click.option("--fresh", is_flag=True, help="Solve again what the journal of an earlier run holds.")
_eigensolver = click.option(
    "--eigensolver",
    type=click.Choice(["own", "slepc"]),
    expose_value=False,
    callback=choose_eigensolver,
    help="slepc: over MPI, where one machine is too small.",
)
_wide = click.option("--wide", is_flag=True, default=None, help="Write changed cards in large field.")


@click.group(cls=GuardedGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="femtune")
def main() -> None:
    """Finite element model updating: from a vibration test and a deck to an updated deck.

    The exit code is 0 where all went well, 1 where the update did not reach an optimum (its results are written) or a
    criterion of validate fails, 2 for input that has to be mended, 70 for a fault of femtune itself, 130 after Ctrl-C.
    """


@main.command()
@click.argument("path", type=_FILE, required=False)
@click.option("--solvers", is_flag=True, help="List the sparse solvers: which are at hand, and what they can do.")
@_json
@_quiet
def info(path: Path | None, solvers: bool, as_json: bool, quiet: bool) -> None:
    """What is in the deck of a study, or in a deck: cards, mass, rigid-body check, supports.

    PATH is a study file (.toml) or a Nastran deck.
    """
    if solvers:
        _show_solvers(as_json)
    elif path is None:
        raise click.UsageError("name a study or a deck, or ask for --solvers")
    else:
        result = run_step("of_model:info", path, quiet)
        out.show("model:info_document", path, result.record, as_json=as_json, quiet=quiet)


def _show_solvers(as_json: bool) -> None:
    """All solvers, as JSON or as text."""
    solvers = load("femtune.model.solvers.listing:solver_list")()
    table = load("femtune.model.solvers.listing:solver_table")
    click.echo(printable(json.dumps([asdict(s) for s in solvers], indent=1) if as_json else table(solvers)))


@main.command()
@click.argument("path", type=_FILE)
@click.option("--report", "page", type=_FILE, metavar="PAGE", help="Write a page (HTML) with a picture of each mode.")
@click.option("--count", type=int, help="Number of modes, in place of that of the study or deck.")
@click.option("--max-hz", type=float, metavar="HZ", help="All modes up to here, in place of --count.")
@click.option("--uff", type=_FILE, metavar="FILE", help="Write the modes as a simulated test (Universal File, 55).")
@click.option("--sensor", "sensors", multiple=True, metavar="12Z+", help='For --uff; or "101 THRU 160:123".')
@click.option("--units", metavar="m-kg-s", help="Units of a deck alone, for --uff.")
@click.option("--frequency-scatter", type=_SCATTER, default=0.0, metavar="PART", help="For --uff: .002 is 0.2 %.")
@click.option("--shape-scatter", type=_SCATTER, default=0.0, metavar="PART", help="For --uff: of the largest entry.")
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="For --uff: of the scatter.")
@_eigensolver
@_fresh
@_json
@_quiet
def modes(
    path: Path,
    page: Path | None,
    fresh: bool,
    as_json: bool,
    quiet: bool,
    count: int | None,
    max_hz: float | None,
    uff: Path | None,
    sensors: tuple[str, ...],
    **scatter: Any,
) -> None:
    """Natural frequencies and modes of each configuration.

    PATH is a study file (.toml) or a Nastran deck.
    """
    if sensors and uff is None:
        raise click.UsageError("--sensor belongs to --uff, which names the file to write")
    simulate = None
    if uff is not None:
        study_of(path)
        simulate = load("femtune.study.simulated_test:SimulatedTest")(uff, sensors, **scatter)
    asked: dict[str, Any] = {"count": count, "max_hz": max_hz, "report": page, "simulate": simulate}
    result = run_step("of_model:modes", path, quiet, fresh=fresh, **asked)
    out.say(result.remarks, quiet)
    out.show("modes:modes_document", path, result.records, as_json=as_json, quiet=quiet)
    out.name_page(page, as_json)


def _given(options: dict[str, Any]) -> dict[str, Any]:
    """Options that are keys of a table; one that may be repeated and was not given is None."""
    return {key: (value or None) if isinstance(value, tuple) else value for key, value in options.items()}


@main.command()
@click.argument("path", type=_FILE)
@click.option("--input", "inputs", multiple=True, metavar="12Z+", help="Driven DOF of the model; may be repeated.")
@click.option("--output", "outputs", multiple=True, metavar="13Z+", help="DOF that moves; may be repeated.")
@click.option("--from", "from_hz", type=float, metavar="HZ", help="First frequency line.")
@click.option("--to", "to_hz", type=float, metavar="HZ", help="Last frequency line.")
@click.option("--step", "step_hz", type=float, metavar="HZ", help="Distance of the lines.")
@click.option("--lines", type=int, help="Number of lines, in place of --step.")
@click.option("--kind", metavar="KIND", help="receptance, mobility or accelerance.")
@click.option("--method", metavar="WAY", help='"real modes", "complex modes" or direct.')
@click.option("--modes", type=int, help="Number of modes that are superposed.")
@click.option("--max-hz", type=float, metavar="HZ", help="Modes up to here are superposed.")
@click.option("--ratio", type=float, help="Damping ratio of all modes, in place of SDAMPING.")
@click.option("--damping", metavar="WORD", help="deck, or modal: no loss factors and dashpots.")
@click.option("--uff", type=_FILE, metavar="FILE", help="Write the functions to a Universal File (58).")
@click.option("--units", metavar="m-kg-s", help="Units of a deck alone, for --uff.")
@click.option("--report", "page", type=_FILE, metavar="PAGE", help="Draw the responses on a page (HTML).")
@_eigensolver
@_fresh
@_json
@_quiet
def respond(path: Path, page: Path | None, fresh: bool, as_json: bool, quiet: bool, **asked: Any) -> None:
    """Frequency responses, complex modes and static displacements.

    PATH is a study file (.toml) or a Nastran deck. Options take the place of keys of [response] in the study.
    """
    result = run_step("of_model:respond", path, quiet, fresh=fresh, report=page, **_given(asked))
    out.say(result.remarks, quiet)
    out.show("modes:responses_document", path, result.records, as_json=as_json, quiet=quiet)
    out.name_page(page, as_json)


@main.command()
@click.argument("path", type=_FILE)
@_output
@click.option("--band", "band_hz", type=(float, float), metavar="LOW HIGH", help="Where modes are looked for, Hz.")
@click.option("--order", "largest_order", type=int, help="Largest model order.")
@click.option("--rate", "sampling_hz", type=float, metavar="HZ", help="Sampling rate, where the file says none.")
@click.option("--variable", metavar="NAME", help="The array, in a file that holds several.")
@click.option("--method", "methods", multiple=True, metavar="NAME", help="N4SID, pLSCF, SSI-cov, ERA …; repeatable.")
@click.option("--fragments", type=int, help="Cut the record into so many, and average over them.")
@click.option("--take", "take_hz", type=float, multiple=True, metavar="HZ", help="Take this cluster; repeatable.")
@click.option("--drop", "drop_hz", type=float, multiple=True, metavar="HZ", help="Drop this cluster; repeatable.")
@click.option("--units", metavar="m-kg-s", help="Units, where the file says none.")
@_json
@_quiet
def identify(path: Path, output: Path | None, as_json: bool, quiet: bool, **asked: Any) -> None:
    """Modes with standard deviations from records in time or measured functions.

    PATH is an identification file (.toml), a record (CSV, UFF, .npy, .npz, .mat, HDF5, WAV) or functions (UFF). Options
    take the place of keys of [identify] in the file.
    """
    result = run_step("of_record:identify", path, quiet, read=identification_of, output=output, **_given(asked))
    if as_json:
        click.echo(out.as_text(result.record))
    elif not quiet:
        out.show_document(load("femtune.reporting.identification:build_identification_page")(result))
    out.name_page(result.report, as_json)


@main.command()
@_study
@_eigensolver
@_fresh
@_json
@_quiet
def correlate(study: Path, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Compare the model with the test: MAC, frequencies, pairs."""
    result = run_step("of_study:correlate", study, quiet, fresh=fresh)
    out.say(result.remarks, quiet)
    shown = (result.records, result.arrays)
    out.show("correlate:correlation_document", study, *shown, as_json=as_json, quiet=quiet)


@main.command()
@_study
@_eigensolver
@_fresh
@_json
@_quiet
def select(study: Path, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Which parameters, and which combinations of them, the data determine."""
    result = run_step("of_study:select", study, quiet, fresh=fresh)
    out.say(result.remarks, quiet)
    out.show("select:selection_document", study, result.record, as_json=as_json, quiet=quiet)


@main.command()
@_study
@_eigensolver
@_fresh
@_json
@_quiet
def quantify(study: Path, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Mean and covariance of the parameters from repeated tests."""
    result = run_step("of_study:quantify", study, quiet, fresh=fresh)
    out.say(result.remarks, quiet)
    out.show("validate:quantify_document", study, result.record, as_json=as_json, quiet=quiet)


@main.command()
@_study
@_output
@_wide
@_eigensolver
@_fresh
@_quiet
def update(study: Path, output: Path | None, wide: bool | None, fresh: bool, quiet: bool) -> None:
    """Find the parameters and write the updated deck.

    A run that was interrupted goes on from what it had solved.
    """
    result = run_step("of_run:update", study, quiet, output=output, wide=wide, fresh=fresh)
    _end(result, quiet, f"results: {Path(result.folder).resolve()}")


@main.command()
@_study
@_output
@_eigensolver
@_fresh
@_json
@_quiet
def validate(study: Path, output: Path | None, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Judge the updated model on data that the update did not use.

    Updates first, as `update` does; what an earlier run had solved is taken from its journal. The exit code is 1 where
    a criterion fails, and where the update did not reach an optimum.
    """
    result = run_step("of_run:validate", study, quiet, output=output, fresh=fresh)
    results = result.results
    out.say(result.remarks, quiet)
    data = results.validation
    out.show("validate:validation_document", study, results, as_json=as_json, quiet=quiet, data=data)
    if out.missed_optimum(result) or any(v.verdict == "fail" for v in data.verdicts):
        click.get_current_context().exit(1)


@main.command()
@_study
@_output
@_wide
@_eigensolver
@_fresh
@_quiet
def run(study: Path, output: Path | None, wide: bool | None, fresh: bool, quiet: bool) -> None:
    """All steps in their order: a run folder with results, updated deck and report.

    A run that was interrupted goes on from what it had solved.
    """
    result = run_step("of_run:run", study, quiet, output=output, wide=wide, fresh=fresh)
    _end(result, quiet, f"report: {Path(result.report).resolve()}")


def _end(result: Any, quiet: bool, last_line: str) -> None:
    """Tables, what the update came to, and at last the report or folder; exit code 1 where there is no optimum."""
    out.say(result.remarks, quiet)
    out.show_run(result, quiet)
    missed = out.missed_optimum(result)
    click.echo(last_line)
    if missed:
        click.get_current_context().exit(1)


@main.command()
@click.argument("path", type=_FILE)
@_quiet
def report(path: Path, quiet: bool) -> None:
    """Write the report of a run again.

    PATH is a run folder, or the study whose run folder is meant.
    """
    page = run_step("pages:report", path, quiet)
    click.echo(f"report: {Path(page).resolve()}")


@main.command()
@click.argument("code")
def explain(code: str) -> None:
    """What the code of an error or notice means, and how to fix it.

    CODE is what a message shows in brackets: deck.missing-include.
    """
    code, known = code.strip("[]"), codes()
    if code not in known:
        close = did_you_mean(code, known)
        hint = close if close.startswith("did") else "codes have the form deck.missing-include"
        raise click.BadParameter(f"'{printable(code)}' is not the code of a message; {hint}", param_hint="CODE")
    click.echo(f"[{code}]\n\n{explanation(code)}")
