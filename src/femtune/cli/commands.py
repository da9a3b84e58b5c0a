"""The commands, each with its options, the step that it runs and how the result is printed.

What they do is in the library; it is imported when a command runs, so that help is quick.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from femtune import __version__
from femtune.cli import output as out
from femtune.cli.guard import BAD_INPUT, GuardedGroup, coloured
from femtune.cli.log import be_verbose, log_to
from femtune.cli.running import identification_of, keep_jobs, load, no_file, run_step, study_of
from femtune.errors import codes, did_you_mean, explanation, meaning, printable

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
_to_file = click.option(
    "--log", type=_FILE, metavar="FILE", expose_value=False, callback=log_to, is_eager=True,
    help="Append steps, warnings and errors, with their times, to a file.",
)  # fmt: skip
_verbose = click.option(
    "-v", "--verbose", is_flag=True, expose_value=False, callback=be_verbose,
    help="Print every step, with its time, on standard error.",
)  # fmt: skip
_no_tables = click.option(
    "--quiet", is_flag=True, help="Print neither progress nor tables; warnings appear on standard error."
)


def _quiet(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options of every command that say how much is told, and where."""
    return _no_tables(_verbose(_to_file(command)))


_jobs = click.option(
    "--jobs", type=click.IntRange(1, 1024), metavar="N", expose_value=False, callback=keep_jobs,
    help="The most runs at a time that do not depend on each other, in place of [parallel].",
)  # fmt: skip
_json = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on standard output.")
_output = click.option("--output", type=_FILE, metavar="FOLDER", help="Run folder, instead of that of the study.")
_fresh = click.option("--fresh", is_flag=True, help="Ignore the journal of an earlier run and solve everything again.")
_eigensolver = click.option(
    "--eigensolver",
    type=click.Choice(["own", "slepc"]),
    expose_value=False,
    callback=choose_eigensolver,
    help="slepc: distributed over MPI, for models too large for one machine.",
)
_wide = click.option("--wide", is_flag=True, default=None, help="Write changed cards in large-field format.")


@click.group(cls=GuardedGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="femtune")
def main() -> None:
    """Finite element model updating: from a vibration test and a deck to an updated deck.

    Exit codes: 0 if the command succeeded, 1 if the update did not reach an optimum (its results are written) or a
    criterion of validate fails, 2 if the input has errors, 70 after an internal error of femtune, 130 after Ctrl-C.
    """


@main.command()
@click.argument("deck", type=_FILE)
@click.argument("test", type=_FILE)
@click.argument("folder", type=_FILE, default=".", required=False)
@click.option("--units", metavar="m-kg-s", help="Units of the deck, instead of guessing them.")
@click.option("--force", is_flag=True, help="Replace files that are there.")
@_json
@_quiet
def init(deck: Path, test: Path, folder: Path, as_json: bool, quiet: bool, **asked: Any) -> None:
    """Write a commented study from a deck and a test: units, sensors, modes and parameters are proposed.

    TEST is a Universal File with modes or FRFs, or a record, from which the modes are identified first. FOLDER is the
    current folder by default; it receives study.toml.
    """
    result = run_step("init.function:init", deck, quiet, read=no_file, test=test, folder=folder, **asked)
    if as_json:
        click.echo(out.as_text(result.record))
        return
    if not quiet:
        click.echo(printable(result.overview))
    click.echo(printable(f"study: {Path(result.path).resolve()}"))


@main.command()
@click.argument("path", type=_FILE)
@_json
@_quiet
def check(path: Path, as_json: bool, quiet: bool) -> None:
    """All mistakes of a study, of its deck and of its tests at once; nothing is solved.

    PATH is a study file (.toml) or a Nastran deck. The exit code is 2 if there are errors.
    """
    result = run_step("check.function:check", path, quiet, read=no_file)
    if as_json:
        click.echo(out.as_text(result.record))
    else:
        for said in (*result.errors, *result.remarks):
            click.echo(f"{coloured(said)}\n", err=True)
        if not quiet:
            click.echo(printable(repr(result).partition("\n")[0].partition(": ")[2]))
    if not result.ok:
        click.get_current_context().exit(BAD_INPUT)


@main.command()
@click.argument("kind", type=click.Choice(["study", "identify"]), default="study")
def schema(kind: str) -> None:
    """JSON Schema of the study file, or of the identification file, for editors."""
    click.echo(load("femtune.files.study_file.json_schema:schema_text")(kind), nl=False)


@main.command()
@click.argument("path", type=_FILE, required=False)
@click.option("--solvers", is_flag=True, help="List the sparse solvers, their availability and capabilities.")
@_json
@_quiet
def info(path: Path | None, solvers: bool, as_json: bool, quiet: bool) -> None:
    """Summary of the deck: cards, mass, rigid-body check, supports, shapes of elements, mesh errors.

    PATH is a study file (.toml) or a Nastran deck.
    """
    if solvers:
        _show_solvers(as_json)
    elif path is None:
        raise click.UsageError("give a study or a deck, or use --solvers")
    else:
        result = run_step("info.function:info", path, quiet)
        out.warn(result, quiet)
        out.show("info.terminal:info_document", path, result.record, as_json=as_json, quiet=quiet)


def _show_solvers(as_json: bool) -> None:
    """All solvers, as JSON or as text."""
    solvers = load("femtune.model.solvers.listing:solver_list")()
    table = load("femtune.model.solvers.listing:solver_table")
    click.echo(printable(json.dumps([asdict(s) for s in solvers], indent=1) if as_json else table(solvers)))


@main.command()
@click.argument("path", type=_FILE)
@click.option("--report", "page", type=_FILE, metavar="PAGE", help="Write an HTML page with a picture of each mode.")
@click.option("--count", type=int, help="Number of modes, instead of that of the study or deck.")
@click.option("--max-hz", type=float, metavar="HZ", help="All modes up to this frequency, instead of --count.")
@click.option("--uff", type=_FILE, metavar="FILE", help="Write the modes as a simulated test (Universal File, 55).")
@click.option("--vtu", type=_FILE, metavar="FILE", help="Write mesh, shapes and parameters for ParaView (.vtu).")
@click.option("--sensor", "sensors", multiple=True, metavar="12Z+", help='For --uff; or "101 THRU 160:123".')
@click.option("--units", metavar="m-kg-s", help="Units, if a deck is given instead of a study; for --uff.")
@click.option(
    "--frequency-scatter",
    type=_SCATTER,
    default=0.0,
    metavar="PART",
    help="For --uff: relative standard deviation of the frequencies, .002 is 0.2 %.",
)
@click.option(
    "--shape-scatter",
    type=_SCATTER,
    default=0.0,
    metavar="PART",
    help="For --uff: standard deviation relative to the largest entry.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=1, show_default=True, help="For --uff: seed of the simulated noise."
)
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
    vtu: Path | None,
    sensors: tuple[str, ...],
    **scatter: Any,
) -> None:
    """Compute the natural frequencies and modes of each configuration.

    PATH is a study file (.toml) or a Nastran deck.
    """
    if sensors and uff is None:
        raise click.UsageError("--sensor requires --uff, the file to write")
    simulate = None
    if uff is not None:
        study_of(path)
        simulate = load("femtune.steps.modes.simulated_test:SimulatedTest")(uff, sensors, **scatter)
    asked: dict[str, Any] = {"count": count, "max_hz": max_hz, "report": page, "simulate": simulate, "vtu": vtu}
    result = run_step("modes.function:modes", path, quiet, fresh=fresh, **asked)
    out.say(result, quiet)
    out.show("modes.terminal:modes_document", path, result.records, as_json=as_json, quiet=quiet)
    out.name_page(page, as_json)


@main.command()
@click.argument("path", type=_FILE)
@click.option("--mode", type=int, metavar="N", help="Mode that is shown first; default: the first elastic mode.")
@click.option("--configuration", metavar="NAME", help="Configuration of a study; default: the first.")
@click.option("--count", type=int, help="Number of modes, instead of that of the study or deck.")
@click.option("--max-hz", type=float, metavar="HZ", help="All modes up to this frequency, instead of --count.")
@click.option("--picture", type=_FILE, metavar="FILE", help="Write a picture (.png) and open no window.")
@_eigensolver
@_fresh
@_quiet
def view(path: Path, fresh: bool, quiet: bool, **asked: Any) -> None:
    """Show a moving mode in a window, or write a picture of it.

    PATH is a study file (.toml) or a Nastran deck.
    """
    picture = run_step("view.function:view", path, quiet, fresh=fresh, **asked)
    if picture is not None:
        click.echo(f"picture: {picture}")


def _given(options: dict[str, Any]) -> dict[str, Any]:
    """Options that are keys of a table; one that may be repeated and was not given is None."""
    return {key: (value or None) if isinstance(value, tuple) else value for key, value in options.items()}


@main.command()
@click.argument("path", type=_FILE)
@click.option("--input", "inputs", multiple=True, metavar="12Z+", help="Excited DOF of the model; repeatable.")
@click.option("--output", "outputs", multiple=True, metavar="13Z+", help="Response DOF of the model; repeatable.")
@click.option("--from", "from_hz", type=float, metavar="HZ", help="First frequency line.")
@click.option("--to", "to_hz", type=float, metavar="HZ", help="Last frequency line.")
@click.option("--step", "step_hz", type=float, metavar="HZ", help="Spacing of the frequency lines.")
@click.option("--lines", type=int, help="Number of lines, instead of --step.")
@click.option("--kind", metavar="KIND", help="receptance, mobility or accelerance.")
@click.option("--method", metavar="WAY", help='"real modes", "complex modes" or direct.')
@click.option("--modes", type=int, help="Number of modes in the superposition.")
@click.option("--max-hz", type=float, metavar="HZ", help="Superpose the modes up to this frequency.")
@click.option("--ratio", type=float, help="Damping ratio of all modes, instead of SDAMPING.")
@click.option("--damping", metavar="WORD", help="deck, or modal (ignores loss factors and dashpots).")
@click.option("--uff", type=_FILE, metavar="FILE", help="Write the functions to a Universal File (58).")
@click.option("--scatter", type=_SCATTER, metavar="PART", help="For --uff: noise relative to the magnitude.")
@click.option("--floor", type=_SCATTER, metavar="PART", help="For --uff: noise relative to the largest magnitude.")
@click.option("--seed", type=click.IntRange(min=0), help="For --uff: seed of the noise.  [default: 1]")
@click.option("--units", metavar="m-kg-s", help="Units, if a deck is given instead of a study; for --uff.")
@click.option("--report", "page", type=_FILE, metavar="PAGE", help="Write an HTML page with plots of the responses.")
@_eigensolver
@_fresh
@_json
@_quiet
def respond(path: Path, page: Path | None, fresh: bool, as_json: bool, quiet: bool, **asked: Any) -> None:
    """Compute frequency responses, complex modes and static displacements.

    PATH is a study file (.toml) or a Nastran deck. Options replace keys of [response] in the study.
    """
    noise = {key: value for key in ("scatter", "floor", "seed") if (value := asked.pop(key)) is not None}
    result = run_step("respond.function:respond", path, quiet, fresh=fresh, report=page, **noise, **_given(asked))
    out.say(result, quiet)
    out.show("modes.terminal:responses_document", path, result.records, as_json=as_json, quiet=quiet)
    out.name_page(page, as_json)


@main.command()
@click.argument("path", type=_FILE)
@click.option("--modes", metavar="LIST", help='Numbers of the target modes: "7 THRU 20".')
@click.option("--band", "band_hz", type=(float, float), metavar="LOW HIGH", help="Target modes of this band, Hz.")
@click.option("--triaxial", type=int, help="Number of triaxial sensors to place.")
@click.option("--uniaxial", type=int, help="Number of uniaxial sensors to place.")
@click.option("--visualisation", type=int, help="Number of further sensors that complete the picture.")
@click.option("--aim", metavar="WORD", help="modes, or parameters: sensors that determine the parameters best.")
@click.option("--data", metavar="WORD", help="What the calibration compares: modes, or frfs.")
@click.option("--exciters", type=int, help="Number of exciters to place.")
@click.option("--placed", multiple=True, metavar="SENSOR", help="Given sensor: 101, or 101Z+; repeatable.")
@click.option("--nodes", metavar="LIST", help='Grid points that are candidates: "101 THRU 300".')
@click.option("--exclude", metavar="LIST", help="Grid points that are no candidates.")
@click.option("--method", metavar="NAME", help="expansion or elimination.")
@click.option("--configuration", metavar="NAME", help="Configuration to be tested, if the study has several.")
@click.option("--uff", type=_FILE, metavar="FILE", help="Write points, axes and trace lines (Universal File, 2411).")
@click.option("--csv", type=_FILE, metavar="FILE", help="Write a table of the sensors.")
@click.option("--units", metavar="m-kg-s", help="Units, if a deck is given instead of a study; for --uff.")
@click.option("--report", "page", type=_FILE, metavar="PAGE", help="Write an HTML page with a picture of the sensors.")
@_eigensolver
@_fresh
@_json
@_quiet
def plan(path: Path, page: Path | None, fresh: bool, as_json: bool, quiet: bool, **asked: Any) -> None:
    """Plan a test: sensors for target modes of the model.

    PATH is a study file (.toml) or a Nastran deck; no test is needed. Options replace keys of [plan] in the study.
    """
    result = run_step("plan.function:plan", path, quiet, fresh=fresh, report=page, **_given(asked))
    out.say(result, quiet)
    out.show("plan.terminal:plan_document", path, result.record, as_json=as_json, quiet=quiet)
    out.name_page(page, as_json)


@main.command()
@click.argument("path", type=_FILE)
@_output
@click.option("--band", "band_hz", type=(float, float), metavar="LOW HIGH", help="Frequency range of the modes, Hz.")
@click.option("--order", "largest_order", type=int, help="Largest model order.")
@click.option("--rate", "sampling_hz", type=float, metavar="HZ", help="Sampling rate, if the file states none.")
@click.option("--variable", metavar="NAME", help="Name of the array, if the file has several.")
@click.option("--method", "methods", multiple=True, metavar="NAME", help="N4SID, pLSCF, SSI-cov, ERA …; repeatable.")
@click.option("--fragments", type=int, help="Divide the record into this number of parts and average.")
@click.option("--take", "take_hz", type=float, multiple=True, metavar="HZ", help="Select this cluster; repeatable.")
@click.option("--drop", "drop_hz", type=float, multiple=True, metavar="HZ", help="Drop this cluster; repeatable.")
@click.option("--units", metavar="m-kg-s", help="Units, if the file states none.")
@_jobs
@_json
@_quiet
def identify(path: Path, output: Path | None, as_json: bool, quiet: bool, **asked: Any) -> None:
    """Identify modes with standard deviations from time records or FRFs.

    PATH is an identification file (.toml), a record (CSV, UFF, .npy, .npz, .mat, HDF5, WAV) or functions (UFF). Options
    replace keys of [identify] in the file.
    """
    result = run_step("identify.function:identify", path, quiet, read=identification_of, output=output, **_given(asked))
    out.warn(result, quiet)
    if as_json:
        click.echo(out.as_text(result.record))
    elif not quiet:
        out.show_document(load("femtune.steps.identify.page:build_identification_page")(result))
    out.name_page(result.report, as_json)


@main.command()
@_study
@click.option("--expand", metavar="METHOD", help="Expand the test shapes to the model: serep, dynamic or mdre.")
@click.option("--uff", type=_FILE, metavar="FILE", help="Write the expanded shapes to a Universal File (55).")
@_eigensolver
@_fresh
@_json
@_quiet
def correlate(study: Path, expand: str | None, uff: Path | None, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Compare the model with the test: frequencies, MAC, mode pairs."""
    result = run_step("correlate.function:correlate", study, quiet, fresh=fresh, expand=expand, uff=uff)
    out.say(result, quiet)
    shown = (result.records, result.arrays)
    out.show("correlate.terminal:correlation_document", study, *shown, as_json=as_json, quiet=quiet)


@main.command()
@click.argument("first", type=_FILE)
@click.argument("second", type=_FILE)
@click.option("--count", type=int, help="Number of modes.")
@click.option("--units", metavar="UNITS", help="Units of both decks: length-mass-s.")
@click.option("--tolerance", type=float, metavar="LENGTH", help="Largest distance of two points that are compared.")
@click.option("--points", type=int, default=300, show_default=True, help="Number of points at most.")
@_json
@_quiet
def compare(first: Path, second: Path, as_json: bool, quiet: bool, **asked: Any) -> None:
    """Compare the modes of two decks of one structure with different meshes: MAC, pairs, frequencies.

    The FIRST deck takes the place of the test.
    """
    result = run_step("compare.function:compare", first, quiet, second=second, **asked)
    out.say(result, quiet)
    shown = (result.records, result.arrays)
    out.show("correlate.terminal:correlation_document", second, *shown, as_json=as_json, quiet=quiet)


@main.command()
@_study
@_eigensolver
@_fresh
@_json
@_quiet
def select(study: Path, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Which parameters and combinations of parameters the data determine."""
    result = run_step("select.function:select", study, quiet, fresh=fresh)
    out.say(result, quiet)
    out.show("select.terminal:selection_document", study, result.record, as_json=as_json, quiet=quiet)


@main.command()
@_study
@_eigensolver
@_fresh
@_jobs
@_json
@_quiet
def quantify(study: Path, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Estimate mean and covariance of the parameters from repeated tests."""
    result = run_step("quantify.function:quantify", study, quiet, fresh=fresh)
    out.say(result, quiet)
    out.show("validate.terminal:quantify_document", study, result.record, as_json=as_json, quiet=quiet)


@main.command()
@_study
@_output
@_wide
@_eigensolver
@_fresh
@_jobs
@_json
@_quiet
def update(study: Path, output: Path | None, wide: bool | None, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Update the parameters and write the updated deck.

    An interrupted run continues from the solutions in its journal.
    """
    result = run_step("update.function:update", study, quiet, output=output, wide=wide, fresh=fresh)
    _end(result, as_json, quiet, f"results: {Path(result.folder).resolve()}")


@main.command()
@_study
@click.option("--design", metavar="NAME", help="orthogonal, factorial, plackett-burman, morris or sobol.")
@click.option("--array", metavar="NAME", help='Orthogonal array: "L18", "L16 4^5" …; the smallest by default.')
@click.option("--levels", type=int, help="Number of levels of each parameter between its bounds.")
@click.option("--trajectories", type=int, help="Of morris: number of trajectories.")
@click.option("--points", type=int, help="Of sobol: number of points, a power of two.")
@click.option("--on", metavar="WORD", help="Of sobol: surrogate, or model.")
@click.option("--runs", type=int, help="Of sobol: runs for the surrogate; ten per parameter by default.")
@click.option("--configuration", metavar="NAME", help="The only configuration whose modes are compared.")
@click.option("--csv", type=_FILE, metavar="FILE", help="Write the table of runs.")
@click.option("--report", "page", type=_FILE, metavar="PAGE", help="Write an HTML page with tables and a picture.")
@_eigensolver
@_fresh
@_jobs
@_json
@_quiet
def screen(study: Path, page: Path | None, fresh: bool, as_json: bool, quiet: bool, **asked: Any) -> None:
    """Which parameters matter for which mode, by designed runs of the model.

    No test is needed. Options replace keys of [screen] in the study.
    """
    result = run_step("screen.function:screen", study, quiet, fresh=fresh, report=page, **asked)
    out.say(result, quiet)
    out.show("screen.terminal:screen_document", study, result.record, as_json=as_json, quiet=quiet)
    out.name_page(page, as_json)


@main.command()
@_study
@click.option("--on", metavar="WORD", help="surrogate, or model.")
@click.option("--runs", type=int, help="Runs of the model for the surrogate; ten per parameter by default.")
@click.option("--infill", type=int, help="Further runs for the surrogate.")
@click.option("--infill-by", metavar="WORD", help="Where further runs are made: improvement, or error.")
@click.option("--infill-until", type=float, help="Of error: error of the surrogate at which further runs end.")
@click.option("--surrogate", metavar="NAME", help="kriging, radial-basis or chaos.")
@click.option("--method", metavar="NAME", help="differential-evolution, genetic or cma-es.")
@click.option("--population", type=int, help="Points of a generation.")
@click.option("--generations", type=int, help="The most generations.")
@click.option("--seeds", type=int, help="Number of searches from different seeds.")
@click.option("--front", type=int, help="Points of the front of frequency errors against other errors.")
@click.option("--csv", type=_FILE, metavar="FILE", help="Write a table of the front.")
@click.option("--report", "page", type=_FILE, metavar="PAGE", help="Write an HTML page with tables and a picture.")
@_eigensolver
@_fresh
@_jobs
@_json
@_quiet
def search(study: Path, page: Path | None, fresh: bool, as_json: bool, quiet: bool, **asked: Any) -> None:
    """Search the whole box for the minimum of the residuals, and confirm it on the model.

    Options replace keys of [search] in the study. `update` writes the updated deck.
    """
    result = run_step("search.function:search", study, quiet, fresh=fresh, report=page, **asked)
    out.say(result, quiet)
    out.show("search.terminal:search_document", study, result.record, as_json=as_json, quiet=quiet)
    out.name_page(page, as_json)


@main.command()
@_study
@_output
@click.option("--report", "page", type=_FILE, metavar="PAGE", help="Write an HTML page with tables and a picture.")
@_eigensolver
@_fresh
@_jobs
@_json
@_quiet
def candidates(study: Path, output: Path | None, page: Path | None, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Update several sets of parameters and compare these candidate models.

    The sets are those of [[candidate]] and [candidates] in the study. An interrupted comparison continues from the
    candidates that had ended.
    """
    result = run_step("candidates.function:candidates", study, quiet, output=output, report=page, fresh=fresh)
    out.say(result, quiet)
    out.show("candidates.terminal:candidates_document", study, result.record, as_json=as_json, quiet=quiet)
    out.name_page(page, as_json)


@main.command()
@_study
@_output
@_eigensolver
@_fresh
@_jobs
@_json
@_quiet
def bootstrap(study: Path, output: Path | None, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Spread of the updated parameters by a bootstrap of the measured FRFs.

    The model is updated first, as by `update`. An interrupted bootstrap continues from the runs that had ended. The
    exit code is 1 if the update did not reach an optimum.
    """
    result = run_step("bootstrap.function:bootstrap", study, quiet, output=output, fresh=fresh)
    out.say(result, quiet)
    results, data = result.results, result.results.bootstrap
    out.show("validate.terminal:bootstrap_document", study, results, as_json=as_json, quiet=quiet, data=data)
    if out.missed_optimum(result) or data is None:
        click.get_current_context().exit(1)


@main.command()
@_study
@_output
@_eigensolver
@_fresh
@_jobs
@_json
@_quiet
def validate(study: Path, output: Path | None, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Compare the updated model with data that the update did not use.

    The model is updated first, as by `update`; solutions of an earlier run are read from its journal. The exit code is
    1 if a criterion fails or the update did not reach an optimum.
    """
    result = run_step("validate.function:validate", study, quiet, output=output, fresh=fresh)
    results = result.results
    out.say(result, quiet)
    data = results.validation
    out.show("validate.terminal:validation_document", study, results, as_json=as_json, quiet=quiet, data=data)
    if out.missed_optimum(result) or any(v.verdict == "fail" for v in data.verdicts):
        click.get_current_context().exit(1)


@main.command()
@_study
@_output
@_wide
@_eigensolver
@_fresh
@_jobs
@_json
@_quiet
def run(study: Path, output: Path | None, wide: bool | None, fresh: bool, as_json: bool, quiet: bool) -> None:
    """Correlate, select, update, validate and report: the run folder receives results, updated deck and report.

    An interrupted run continues from the solutions in its journal.
    """
    result = run_step("run.function:run", study, quiet, output=output, wide=wide, fresh=fresh)
    _end(result, as_json, quiet, f"report: {Path(result.report).resolve()}")


def _end(result: Any, as_json: bool, quiet: bool, last_line: str) -> None:
    """Tables or JSON, what the update came to, and at last the report or folder; exit code 1 without an optimum."""
    out.say(result, quiet)
    if as_json:
        click.echo(out.as_text(result.results))
    else:
        out.show_run(result, quiet)
    missed = out.missed_optimum(result)
    click.echo(last_line, err=as_json)
    if missed:
        click.get_current_context().exit(1)


@main.command()
@click.argument("path", type=_FILE)
@_json
@_quiet
def report(path: Path, as_json: bool, quiet: bool) -> None:
    """Rewrite the report of a run.

    PATH is a run folder, or a study with a run folder.
    """
    page = str(Path(run_step("report.function:report", path, quiet)).resolve())
    click.echo(json.dumps({"report": page}) if as_json else f"report: {page}")


@main.command()
@click.argument("code")
@_json
def explain(code: str, as_json: bool) -> None:
    """Explain the code of an error or notice, and how to fix it.

    CODE is what a message shows in brackets: deck.missing-include.
    """
    code, known = code.strip("[]"), codes()
    if code not in known:
        close = did_you_mean(code, known)
        hint = close if close.startswith("did") else "codes have the form deck.missing-include"
        raise click.BadParameter(f"'{printable(code)}' is not the code of a message; {hint}", param_hint="CODE")
    click.echo(json.dumps({"code": code, **meaning(code)}) if as_json else f"[{code}]\n\n{explanation(code)}")
