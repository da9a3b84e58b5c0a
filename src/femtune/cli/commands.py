"""The commands. What they do is in the library; it is imported when a command runs, so that help is quick."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from femtune import __version__
from femtune.cli.eigensolver import choose_eigensolver
from femtune.cli.guard import GuardedGroup, Running
from femtune.errors import printable

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
        _show("info", path, as_json, quiet)


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
    more = {} if uff is None else {"simulate": _simulated(uff, sensors, scatter)}
    _show("modes", path, as_json, quiet, fresh, page, count=count, max_hz=max_hz, **more)


def _simulated(uff: Path, sensors: tuple[str, ...], scatter: dict[str, Any]) -> Any:
    """What the options say of a simulated test."""
    return importlib.import_module("femtune.study.simulated_test").SimulatedTest(uff, sensors, **scatter)


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
    files = {name: asked.pop(name) for name in ("uff", "units")}
    options = {key: (value or None) if isinstance(value, tuple) else value for key, value in asked.items()}
    _show("respond", path, as_json, quiet, fresh, page, options=options, **files)


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
    options = {key: (value or None) if isinstance(value, tuple) else value for key, value in asked.items()}
    _end_of_identification(_do("identify", path, quiet, output=output, options=options), as_json, quiet)


def _end_of_identification(made: Any, as_json: bool, quiet: bool) -> None:
    """The modes as JSON or as tables, and at last the page."""
    from femtune.cli import output  # noqa: PLC0415
    from femtune.report import build_identification_page  # noqa: PLC0415

    if as_json:
        click.echo(output.as_text(made.record))
    elif not quiet:
        output.show_document(build_identification_page(made))
    click.echo(f"report: {printable(str((made.folder / 'report.html').resolve()))}", err=as_json)


@main.command()
@_study
@_eigensolver
@_fresh
@_json
@_quiet
def correlate(study: Path, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Compare the model with the test: MAC, frequencies, pairs."""
    _show("correlate", study, as_json, quiet, fresh)


@main.command()
@_study
@_eigensolver
@_fresh
@_json
@_quiet
def select(study: Path, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Which parameters, and which combinations of them, the data determine."""
    _show("select", study, as_json, quiet, fresh)


@main.command()
@_study
@_eigensolver
@_fresh
@_json
@_quiet
def quantify(study: Path, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Mean and covariance of the parameters from repeated tests."""
    _show("quantify", study, as_json, quiet, fresh)


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
    folder = _do("update", study, quiet, output=output, wide=wide, fresh=fresh)
    _end(folder, quiet)


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
    folder = _do("validate", study, quiet, output=output, fresh=fresh)
    _end_of_validation(study, folder, as_json, quiet)


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
    folder = _do("run", study, quiet, output=output, wide=wide, fresh=fresh)
    _end(folder, quiet, folder.report)


@main.command()
@click.argument("path", type=_FILE)
@_quiet
def report(path: Path, quiet: bool) -> None:
    """Write the report of a run again.

    PATH is a run folder, or the study whose run folder is meant.
    """
    page = _do("report", path, quiet)
    click.echo(f"report: {Path(page).resolve()}")


def _show_solvers(as_json: bool) -> None:
    """All solvers, as JSON or as text."""
    module = importlib.import_module("femtune.model.solver_list")
    solvers = module.solver_list()
    text = json.dumps([asdict(facts) for facts in solvers], indent=1) if as_json else module.solver_table(solvers)
    click.echo(printable(text))


def _do(step: str, path: Path, quiet: bool, **options: Any) -> Any:
    """Run a step of the library with a progress display."""
    # rich is imported here, so that help is quick
    from femtune.cli.display import Display  # noqa: PLC0415

    click.get_current_context().find_root().obj = Running(path, options.get("output"))
    function: Callable[..., Any] = getattr(importlib.import_module("femtune.steps"), step)
    with Display(quiet) as progress:
        return function(path, progress=progress, **options)


def _show(
    step: str, path: Path, as_json: bool, quiet: bool, fresh: bool = False, page: Path | None = None, **more: Any
) -> None:
    """The result of one step, as JSON or as tables, and on a `page`; tables of a comparison take its matrices too."""
    from femtune.cli import output  # noqa: PLC0415

    arrays: dict[str, Any] = {}
    remarks: list[str] = []
    options = more if step == "info" else {"fresh": fresh, "remarks": remarks, **more}
    if page is not None:
        results = _do(f"{step}_report", path, quiet, page=page, **options)
        result = results.responses if step == "respond" else results.modes
    else:
        result = _do(step, path, quiet, **options, **({"arrays": arrays} if step == "correlate" else {}))
    _say(remarks, quiet)
    if as_json:
        click.echo(output.as_text(result))
    elif not quiet:
        output.show_document(output.document_of_step(step, path, result, arrays))
    if page is not None:
        # standard output is the JSON's alone
        click.echo(f"report: {printable(str(page.resolve()))}", err=as_json)


def _say(remarks: list[str], quiet: bool) -> None:
    """Sentences beside the result."""
    for remark in () if quiet else remarks:
        click.echo(printable(remark), err=True)


def _end(folder: Any, quiet: bool, page: Path | None = None) -> None:
    """Tables, what the update came to, and at last the report or folder; exit code 1 where there is no optimum."""
    from femtune.cli import output  # noqa: PLC0415
    from femtune.cli.display import Display  # noqa: PLC0415

    _say(output.remarks_of(folder.results), quiet)
    if not quiet:
        with Display() as progress:
            document = output.document_of(folder, progress)
        output.show_document(document)
    outcome = folder.results.update
    if outcome is not None and not outcome.ok:
        click.echo(f"{outcome.status}: {outcome.message}", err=True)
    click.echo(f"results: {Path(folder.folder).resolve()}" if page is None else f"report: {Path(page).resolve()}")
    if outcome is not None and not outcome.ok:
        click.get_current_context().exit(1)


def _end_of_validation(path: Path, folder: Any, as_json: bool, quiet: bool) -> None:
    """Verdicts as JSON or as tables; exit code 1 where one fails or the update has no optimum."""
    from femtune.cli import output  # noqa: PLC0415

    results = folder.results
    _say(output.remarks_of(results), quiet)
    if as_json:
        click.echo(output.as_text(results.validation))
    elif not quiet:
        output.show_document(output.document_of_step("validate", path, results, {}))
    missed = results.update is not None and not results.update.ok
    if missed:
        click.echo(f"{results.update.status}: {results.update.message}", err=True)
    if missed or any(v.verdict == "fail" for v in results.validation.verdicts):
        click.get_current_context().exit(1)
