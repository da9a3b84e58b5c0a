"""Results as labelled arrays; requires xarray (``pip install "femtune[xarray]"``)."""

from __future__ import annotations

import warnings
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune._optional import require
from femtune.arguments import checked
from femtune.errors import FemtuneError
from femtune.modal import FrfSet, ModeSet
from femtune.steps.correlate.record.correlation import CorrelationResults
from femtune.steps.correlate.result import CorrelateResult
from femtune.steps.modes.result import ModesResult
from femtune.steps.quantify.result import QuantifyResult
from femtune.steps.respond.result import RespondResult
from femtune.steps.result import Arrays
from femtune.steps.run.result import RunResult
from femtune.steps.select.result import SelectResult

if TYPE_CHECKING:
    from femtune.steps.identify.result import IdentifyResult

Variables = dict[str, tuple[tuple[str, ...], Any, dict[str, str]]]
"""Dimensions, values and attributes by name."""


@checked
def to_xarray(
    result: ModeSet
    | FrfSet
    | ModesResult
    | RespondResult
    | CorrelateResult
    | SelectResult
    | QuantifyResult
    | RunResult
    | IdentifyResult,
    configuration: str | None = None,
) -> Any:
    """A result as ``xarray.Dataset`` whose dimensions have names and coordinates: mode, sensor, test, model, frequency.

    Parameters
    ----------
    result : the result of a step, or a `ModeSet` or `FrfSet`
    configuration : name of the configuration, if there are several

    Returns
    -------
    xarray.Dataset, with units in the attributes of the variables

    Raises
    ------
    FemtuneError : ``install.missing`` without xarray; ``study.unknown-configuration``

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> data = ft.to_xarray(ft.correlate(model, test))
    >>> data.mac.dims
    ('test', 'model')
    >>> data.mac.sel(test="1", model=1).item() > 0.99
    True
    """
    dataset = require("xarray", extra="xarray").Dataset
    variables, coordinates = _parts(result, configuration)
    return dataset(variables, coords=coordinates)


Parts = tuple[Variables, dict[str, Any]]


@singledispatch
def _parts(result: Any, configuration: str | None) -> Parts:
    """Variables and coordinates of a result."""
    # the class of an identification's result must not be imported here; it is recognised by its attributes
    if hasattr(result, "found") and isinstance(getattr(result, "modes", None), ModeSet):
        return _of_modes(result.modes, configuration)
    raise FemtuneError("plot.nothing-to-draw/no-arrays", result=type(result).__name__)


@_parts.register
def _of_modes(result: ModeSet, configuration: str | None) -> Parts:
    variables: Variables = {
        "freq_hz": (("mode",), result.freq_hz, {"units": "Hz"}),
        "shape": (("sensor", "mode"), result.shapes, {"normalisation": result.normalisation}),
    }
    for name in ("damping_ratio", "freq_sd_hz", "damping_sd"):
        if getattr(result, name) is not None:
            variables[name] = (("mode",), getattr(result, name), {"units": "Hz"} if name.endswith("_hz") else {})
    return variables, {"mode": list(result.labels), "sensor": result.dofs.labels()}


@_parts.register
def _of_functions(result: FrfSet, configuration: str | None) -> Parts:
    at = {"output": result.responses.labels(), "input": result.references.labels(), "frequency": result.freq_hz}
    variables: Variables = {result.kind: (("output", "input", "frequency"), result.values, {})}
    if result.coherence is not None:
        variables["coherence"] = (("output", "input", "frequency"), result.coherence, {})
    return variables, at


@_parts.register
def _of_solved(result: ModesResult, configuration: str | None) -> Parts:
    name = configuration or result._only("mode_set").configuration
    return _of_modes(result.mode_sets[result[name].configuration], None)


@_parts.register
def _of_responses(result: RespondResult, configuration: str | None) -> Parts:
    name = configuration or result._only("frf_set").configuration
    if result[name].frfs is None:
        raise FemtuneError("response.nothing-asked/no-frfs")
    return _of_functions(result.frf_sets[name], None)


@_parts.register
def _of_correlation(result: CorrelateResult, configuration: str | None) -> Parts:
    record = result._only("mac") if configuration is None else result[configuration]
    return _compared(record, result.arrays)


def _compared(record: CorrelationResults, arrays: Arrays) -> Parts:
    of_pairs = {p.test_label: p for p in record.pairs}
    errors = [of_pairs[t].freq_error_percent if t in of_pairs else np.nan for t in record.mac_test_labels]
    variables: Variables = {
        "test_freq_hz": (("test",), list(record.mac_test_freq_hz), {"units": "Hz"}),
        "model_freq_hz": (("model",), list(record.mac_model_freq_hz), {"units": "Hz"}),
        "freq_error": (("test",), errors, {"units": "%"}),
    }
    for name, key in (("mac", record.mac_key), ("cross_orthogonality", record.cross_orthogonality_key)):
        if key is not None:
            variables[name] = (("test", "model"), arrays[key], {})
    if record.comac:
        variables["comac"] = (("sensor",), [c.comac for c in record.comac], {})
    at: dict[str, Any] = {"test": list(record.mac_test_labels), "model": list(record.mac_model_numbers)}
    return variables, at | ({"sensor": [c.dof for c in record.comac]} if record.comac else {})


@_parts.register
def _of_selection(result: SelectResult, configuration: str | None) -> Parts:
    names = list(result.record.column_labels)
    variables: Variables = {"jacobian": (("residual", "parameter"), result.jacobian, {})}
    if result.correlation is not None:
        variables["correlation"] = (("parameter", "other"), result.correlation, {})
    return variables, {"residual": list(result.record.row_labels), "parameter": names, "other": names}


@_parts.register
def _of_repeats(result: QuantifyResult, configuration: str | None) -> Parts:
    names = [row.parameter for row in result.parameters]
    variables: Variables = {
        "mean": (("parameter",), result.parameters.column("mean"), {}),
        "covariance": (("parameter", "other"), result.covariance, {}),
        "measured_hz": (("repeat", "mode"), result.repeats, {"units": "Hz"}),
        "model_hz": (("sample", "mode"), result.cloud, {"units": "Hz"}),
    }
    return variables, {"parameter": names, "other": names, "mode": [row.label for row in result.frequencies]}


@_parts.register
def _of_run(result: RunResult, configuration: str | None) -> Parts:
    table = result.parameters
    variables, at = _of_correlation(result.after, configuration)
    for name in ("nominal", "value", "sd"):
        variables[name] = (("parameter",), table.column(name), {})
    history = result.history
    names = [row.name for row in table if row.name in history.columns]
    way = np.array([[row[name] for name in names] for row in history])
    variables["history"] = (("iteration", "free"), way, {})
    variables["objective_percent"] = (("iteration",), history.column("objective_percent"), {"units": "%"})
    return variables, at | {
        "parameter": [row.name for row in table],
        "free": names,
        "iteration": [row.iteration for row in history],
    }


@checked
def to_inference_data(result: RunResult, seed: int = 0) -> Any:
    """The samples of a posterior as ``arviz.InferenceData``; requires ArviZ (``pip install "femtune[arviz]"``).

    ArviZ has no weights, so that as many samples of equal weight are drawn: each weighted one as often as its weight
    asks for, up to the rounding of one random number (systematic resampling).

    Parameters
    ----------
    result : of a run with [posterior]
    seed : of the resampling

    Returns
    -------
    arviz.InferenceData with the group ``posterior``: each parameter in its unit, and the sizes of the errors as
    ``size of …``, of shape (1, draws); the attributes have the evidence, k̂ and the effective number of samples

    Raises
    ------
    FemtuneError : ``install.missing`` without ArviZ; ``posterior.none`` without samples

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> free = [ft.Parameter("root", fields=["PBAR 1 I1"], lower=0.5, upper=2.0)]
    >>> asked = {"noise": "stated", "draws": 100, "starts": 0, "discrepancy": "none"}
    >>> found = ft.posterior(
    ...     model, test, parameters=free, residuals=[ft.FrequencyResidual(sd=0.01)], posterior=asked
    ... )
    >>> ft.to_inference_data(found).posterior["root"].shape
    (1, 100)
    """
    record = result.results.posterior
    if record is None:
        raise FemtuneError("posterior.none")
    with warnings.catch_warnings():
        # its announcement of the next version
        warnings.simplefilter("ignore")
        from_dict = require("arviz", extra="arviz").from_dict
    weights, n = np.asarray(result.arrays[record.weights_key]), record.draws
    at = (np.arange(n) + np.random.default_rng(seed).uniform()) / n
    chosen = np.minimum(np.searchsorted(np.cumsum(weights), at), n - 1)
    samples, sizes = result.arrays[record.samples_key][chosen], result.arrays[record.sizes_key][chosen]
    estimated = [level.residuals for level in record.noise_levels if level.interval_95 is not None]
    names = [*record.free, *(f"size of {what}" for what in (*estimated, *(c.what for c in record.model_errors)))]
    values = dict(zip(names, np.hstack([samples, sizes]).T[:, None, :], strict=True))
    attributes = {
        "log_evidence": record.log_evidence, "log_evidence_sd": record.log_evidence_sd, "k_hat": record.k_hat,
        "effective_samples": record.effective, "inference_library": "femtune",
    }  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return from_dict(posterior=values, attrs=attributes)
