"""Files in and out: decks, matrices and tests."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.arguments import checked
from femtune.errors import FemtuneError, Where
from femtune.files.nastran.build import BuiltDeck
from femtune.files.nastran.field_refs import parse_field_ref, resolve
from femtune.files.nastran.write import plan_edits
from femtune.files.nastran.write import write_deck as write_files
from femtune.files.shape_table import is_shape_table, read_shape_table
from femtune.files.uff import read_uff, write_uff_frfs, write_uff_modes
from femtune.study.described import Model, model_of_deck, model_of_function, model_of_matrices, units_word
from femtune.study.given_test import modal_test_of_arrays
from femtune.units import SI, unit_system

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from femtune.dofs import DofSet
    from femtune.testdata import ModalTest
    from femtune.units import UnitSystem


@checked
def read_deck(path: Path | str, *, units: str | UnitSystem | None = None, allow_ignored: Sequence[str] = ()) -> Model:
    """Read a Nastran deck, with its INCLUDEs.

    Parameters
    ----------
    path : the main file
    units : length-mass-s of the deck: "m-kg-s", "mm-t-s", "in-slinch-s" …; required for the comparison with a test
    allow_ignored : names of unsupported element cards that may be ignored

    Raises
    ------
    FemtuneError : ``deck.*`` with file and line, several together; ``units.unknown``

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> model = ft.read_deck(example_deck(), units="m-kg-s")
    >>> ft.modes(model, count=3).freq_hz.round(2)
    array([ 28.27,  44.7 , 201.1 ])
    """
    return model_of_deck(path, units, allow_ignored)


@checked
def read_matrices(
    stiffness: Any,
    mass: Any,
    *,
    viscous: Any = (),
    hysteretic: Any = (),
    dofs: Path | str | Sequence[Any] | NDArray[Any] | DofSet | None = None,
    units: str | UnitSystem | None = None,
    **words: Any,
) -> Model:
    """A model of matrices: arrays of NumPy or SciPy, or files of another solver (OP4, OP2, DMIG, Abaqus, CalculiX,
    Matrix Market, Ansys).

    Parameters
    ----------
    stiffness, mass, viscous, hysteretic : (n, n) symmetric array, dense or sparse; a file; or a list of mappings with
        the keys of [[matrix]]: ``name``, ``file`` (a file or an array), ``record``, ``format``, ``factor``, ``at``; a
        parameter changes the factor of a matrix by its name, which is K, M, C or H for a single one
    dofs : node and direction of each of the n rows: ``"12Z"`` or (node, component 1 to 6, 0 for a scalar point), also
        as an array; or a file that lists them. Rows of arrays without it are scalar points 1 to n
    units : length-mass-s of the matrices; required for the comparison with a test
    words : keys of [model]: ``grid``, ``hold_singular``, ``listed_hz``, ``listing`` …; and ``variable``, a list of
        mappings with the keys of [[variable]]

    Raises
    ------
    FemtuneError : ``call.argument`` for an array of another shape, ``matrices.*``, ``study.missing-file``, several
        together

    Examples
    --------
    >>> import femtune as ft
    >>> import numpy as np, scipy.sparse as sp
    >>> K = sp.diags_array([np.full(3, 2e4), np.full(2, -1e4), np.full(2, -1e4)], offsets=[0, 1, -1])
    >>> model = ft.read_matrices(K, 2.0 * np.eye(3), dofs=["1Z", "2Z", "3Z"])
    >>> ft.modes(model, count=2).freq_hz.round(3)
    array([ 8.613, 15.915])
    """
    kinds = {"stiffness": stiffness, "mass": mass, "viscous": viscous, "hysteretic": hysteretic}
    return model_of_matrices(kinds, units, dofs, **words)


@checked
def own_model(
    model: Any,
    *,
    count: int,
    dofs: Sequence[Any] | NDArray[Any] | DofSet | None = None,
    units: str | UnitSystem | None = None,
    version: str = "",
) -> Model:
    """A model of your own: a Python function of the parameters, or an object.

    It takes the place of an external solver, see the guide page on external solvers: k parameters take 2k + 1 calls at
    each point of an update, or one if derivatives are given.

    Parameters
    ----------
    model : a function of a dictionary of the values by name, which returns frequencies (m,) in Hz, or frequencies and
        shapes (n, m); or an object with such a method ``modes`` and, where derivatives are known, a method
        ``derivatives`` that returns them by name of the parameter, in the form of what ``modes`` returns
    count : number of modes that it returns, at least
    dofs : (n,) node and direction of each row of the shapes, as for `read_matrices`
    units : length-mass-s of the model; required for the comparison with a test
    version : a word that changes where the model does; then runs in the folder of an earlier program are used again.
        Without it they are not

    Raises
    ------
    FemtuneError : ``call.argument``, ``dof.*``, ``units.unknown``; ``external.own-model`` when the study is read, for a
        model that returns something else

    Examples
    --------
    >>> import numpy as np
    >>> import femtune as ft
    >>> def chain(values):
    ...     stiffness = np.array([[values["k1"] + values["k2"], -values["k2"]], [-values["k2"], values["k2"]]])
    ...     return np.sqrt(np.linalg.eigvalsh(stiffness)) / (2 * np.pi)
    >>> found = ft.update(
    ...     ft.own_model(chain, count=2, units="m-kg-s"),
    ...     ft.modal_test([10.0, 25.0]),
    ...     parameters=[ft.Parameter(k, lower=5e3, upper=2e4, absolute=True) for k in ("k1", "k2")],
    ...     residuals=[ft.FrequencyResidual(sd=0.01)],
    ... )
    >>> bool(np.allclose(chain(found.values), [10.0, 25.0], rtol=1e-4))
    True
    """
    return model_of_function(model, count, dofs, units, version)


@checked
def read_test(
    path: Path | str, *, units: str | UnitSystem | None = None, records: str | None = None, name: str = ""
) -> ModalTest:
    """Read a test from a Universal File (geometry, modes, frequency response functions) or from a table of mode shapes.

    Parameters
    ----------
    path : the file (UFF, UNV), or a table of shapes (CSV, MAT, NPZ; see the guide page on tests)
    units : length-mass-s, if the file has no data set 164 with the units; a study converts the test to its own
    records : read only the modes whose ID lines contain this word
    name : of the test; else `records`, else the name of the file

    Raises
    ------
    FemtuneError : ``uff.*`` or ``test.shapes`` with the line of the file, ``units.unknown``

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_test
    >>> test = ft.read_test(example_test())
    >>> test.modes.freq_hz.round(2), test.modes.shapes.shape
    (array([ 27.08,  44.7 , 202.89, 317.97]), (8, 4))
    """
    system = None if units is None else unit_system(units_word(units))
    if is_shape_table(Path(path)):
        return read_shape_table(Path(path), system or SI, name)
    return read_uff(path, units=None, file_units=system, records=records, name=name).test


@checked
def modal_test(
    freq_hz: Any,
    shapes: Any = None,
    *,
    dofs: Sequence[Any] | NDArray[Any] | DofSet | None = None,
    freq_sd_hz: Any = None,
    damping_ratio: Any = None,
    points: Any = None,
    units: str | UnitSystem | None = None,
    name: str = "",
) -> ModalTest:
    """A test from arrays: measured frequencies, with or without mode shapes.

    Parameters
    ----------
    freq_hz : (m,) frequencies in Hz; or an object with the modes: a result of pyOMA2, an EMA model of sdypy, or a table
        of eigenvectors of pyNastran, whose shapes, damping and standard deviations are taken where they are not given
    shapes : (n, m) real or complex, in any scale; NaN marks an entry that was not measured. Without shapes the
        frequencies are compared in their order
    dofs : (n,) node and direction of each row, as for `read_matrices`; scalar points 1 to n without it
    freq_sd_hz : (m,) standard deviations in Hz, or one for all; residuals take them with ``sd="test"``
    damping_ratio : (m,) fractions of critical damping, or one for all
    points : coordinates by node number, ``{1: (0.0, 0.0, 0.5)}``, in the length unit of the test. Without them the
        numbers of the nodes are those of the model: ``sensors={"by_id": True}``, which need not be stated for matrices
        whose nodes have no coordinates
    units : length-mass-s of the test; "m-kg-s" if it is not given
    name : of the test

    Raises
    ------
    FemtuneError : ``call.argument`` with the argument, its shape and the one that is expected; ``dof.*``,
        ``units.unknown``

    Examples
    --------
    >>> import femtune as ft
    >>> ft.modal_test([8.6, 15.9], [[0.5, 0.7], [0.7, 0.0], [0.5, -0.7]], dofs=["1Z", "2Z", "3Z"], freq_sd_hz=0.02)
    ModalTest: arrays, 0 points, 0 sensors, 2 modes, units m-kg-s
    """
    system = SI if units is None else unit_system(units_word(units))
    return modal_test_of_arrays(
        freq_hz, shapes, dofs, freq_sd_hz=freq_sd_hz, damping_ratio=damping_ratio, points=points, units=system,
        name=name,
    )  # fmt: skip


@checked
def write_deck(model: Model | Path | str, values: Mapping[str, float], path: Path | str, *, wide: bool = False) -> Path:
    """Write a deck with other values in some of its fields; all other lines are copied without change.

    G of a MAT1 that is given beside E and NU, and agrees with them, changes with E and NU.

    Parameters
    ----------
    model : what `read_deck` returned, or the path of a deck
    values : new values by field, ``{"PBAR 1 I1": 2.5e-7}``, in units of the deck
    path : the main file to write; INCLUDEs that change are written beside it
    wide : write changed cards in large-field format (16 columns) if a value does not fit 8 columns

    Raises
    ------
    FemtuneError : ``study.unknown-field``, ``write.*``, ``run.unwritable``

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> stiffer = ft.write_deck(example_deck(), {"PBAR 1 I1": 4.0e-7}, "stiffer.bdf")
    >>> ft.modes(stiffer, count=2).freq_hz.round(2)
    array([38.29, 44.7 ])
    """
    read = model if isinstance(model, Model) else read_deck(model)
    built = read.built
    if not isinstance(built, BuiltDeck):
        raise FemtuneError("write.no-deck")
    refs = {parse_field_ref(field): float(value) for field, value in values.items()}
    for ref in refs:
        resolve(built, ref)
    refs |= built.structure.values.with_own(refs).following(refs, built.fields)
    path = Path(path)
    return write_files(plan_edits(built, refs, wide=wide).edited, path.parent, path.name).main


@checked
def write_test(test: ModalTest, path: Path | str) -> Path:
    """Write a test as a Universal File: its modes or, if it has none, its frequency response functions.

    Parameters
    ----------
    test : what `read_test` or `simulate` returned
    path : the file

    Raises
    ------
    FemtuneError : ``uff.cannot-write`` if the format cannot store the data, or the file cannot be written;
        ``write.overwrites-input`` for the file from which the test was read

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> test = ft.simulate(example_deck(), ["2 THRU 5:23"], units="m-kg-s", count=4)
    >>> ft.read_test(ft.write_test(test, "test.uff")).modes.freq_hz.round(2)
    array([ 28.27,  44.7 , 201.1 , 317.97])
    """
    if test.source and os.path.exists(test.source) and os.path.exists(path) and os.path.samefile(test.source, path):
        raise FemtuneError("write.overwrites-input/test", where=Where(str(path)))
    if test.modes is None and test.frfs is not None:
        return write_uff_frfs(path, test)
    write_uff_modes(path, test)
    return Path(path)
