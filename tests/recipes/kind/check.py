"""The kernel is a word of the study file; a surrogate with it meets its runs, predicts others and has derivatives."""

import sys
from pathlib import Path

import numpy as np

import femtune as ft
from femtune.files.study_file.json_schema import schema_text
from femtune.surrogates import RadialRules, fit_surrogate

assert Path(ft.__file__).parent == Path(sys.argv[1])
assert '"multiquadric"' in schema_text("study")
rng = np.random.default_rng(7)
runs, fresh = rng.random((60, 2)), 0.1 + 0.8 * rng.random((50, 2))


def response(x: np.ndarray) -> np.ndarray:
    """(n, 1) of a smooth function."""
    return np.sin(2.0 * x[:, :1]) + x[:, 1:] ** 2


surrogate = fit_surrogate(runs, response(runs), RadialRules(kernel="multiquadric", noise="none"))
assert np.allclose(surrogate.predict(runs), response(runs), atol=1e-6)
assert np.max(np.abs(surrogate.predict(fresh) - response(fresh))) < 1e-2
steps = 1e-5 * np.eye(2)
central = np.stack([(surrogate.predict(fresh + h) - surrogate.predict(fresh - h)) / 2e-5 for h in steps], axis=-1)
assert np.allclose(surrogate.gradient(fresh), central, atol=1e-5)
