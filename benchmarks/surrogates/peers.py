"""Surrogates of femtune and of other libraries: (points, responses, fresh points) → predictions at the fresh points."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

import numpy as np
from scipy.interpolate import RBFInterpolator

from femtune.surrogates import ChaosRules, KrigingRules, RadialRules, SurrogateRules, fit_surrogate

Predict = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
BOX = (np.zeros(4), np.ones(4))


def ours(rules: SurrogateRules) -> Predict:
    """femtune."""
    return lambda x, y, new: fit_surrogate(x, y, rules, BOX).predict(new)


def radial(kernel: str) -> Predict:
    """Radial basis functions of SciPy with a linear trend, through all runs."""
    return lambda x, y, new: RBFInterpolator(x, y, kernel=kernel, degree=1, epsilon=1.0)(new)


def scikit_learn(x: np.ndarray, y: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Gaussian processes of each response, with a length for each parameter and estimated noise."""
    from sklearn.gaussian_process import GaussianProcessRegressor  # noqa: PLC0415
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel  # noqa: PLC0415

    out = []
    for column in y.T:
        kernel = ConstantKernel(1.0, (1e-3, 1e6)) * RBF([1.0] * 4, (0.05, 50.0)) + WhiteKernel(1e-6, (1e-12, 1.0))
        process = GaussianProcessRegressor(kernel, normalize_y=True, n_restarts_optimizer=2, random_state=0)
        out.append(process.fit(x, column).predict(new))
    return np.stack(out, axis=1)


def smt(x: np.ndarray, y: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Kriging of each response: constant trend, Gaussian correlation with a length for each parameter."""
    from smt.surrogate_models import KRG  # noqa: PLC0415

    out = []
    for column in y.T:
        model = KRG(theta0=[1e-1] * 4, poly="constant", corr="squar_exp", print_global=False)
        model.set_training_values(x, column[:, None])
        model.train()
        out.append(model.predict_values(new)[:, 0])
    return np.stack(out, axis=1)


def openturns_kriging(x: np.ndarray, y: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Kriging of each response: constant trend, squared exponential covariance with a length for each parameter."""
    import openturns as ot  # noqa: PLC0415

    out = []
    for column in y.T:
        basis, covariance = ot.ConstantBasisFactory(4).build(), ot.SquaredExponential([1.0] * 4, [1.0])
        if hasattr(ot, "GaussianProcessFitter"):
            fitter = ot.GaussianProcessFitter(ot.Sample(x), ot.Sample(column[:, None]), covariance, basis)
            fitter.run()
            regression = ot.GaussianProcessRegression(fitter.getResult())
            regression.run()
            result = regression.getResult()
        else:
            algorithm = ot.KrigingAlgorithm(ot.Sample(x), ot.Sample(column[:, None]), covariance, basis)
            algorithm.run()
            result = algorithm.getResult()
        out.append(np.array(result.getMetaModel()(ot.Sample(new)))[:, 0])
    return np.stack(out, axis=1)


def chaos(degree: int) -> Predict:
    """Polynomial chaos of OpenTURNS: Legendre polynomials to a degree, a sparse set chosen by least angles."""

    def predict(x: np.ndarray, y: np.ndarray, new: np.ndarray) -> np.ndarray:
        import openturns as ot  # noqa: PLC0415

        law = ot.JointDistribution([ot.Uniform(0.0, 1.0)] * 4)
        out = []
        for column in y.T:
            enumerate_ = ot.LinearEnumerateFunction(4)
            basis = ot.OrthogonalProductPolynomialFactory([ot.LegendreFactory()] * 4, enumerate_)
            chosen = ot.LeastSquaresMetaModelSelectionFactory(ot.LARS(), ot.CorrectedLeaveOneOut())
            algorithm = ot.FunctionalChaosAlgorithm(
                ot.Sample(x), ot.Sample(column[:, None]), law,
                ot.FixedStrategy(basis, enumerate_.getStrataCumulatedCardinal(degree)),
                ot.LeastSquaresStrategy(chosen),
            )  # fmt: skip
            algorithm.run()
            out.append(np.array(algorithm.getResult().getMetaModel()(ot.Sample(new)))[:, 0])
        return np.stack(out, axis=1)

    return predict


def smt_radial(x: np.ndarray, y: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Radial basis functions: Gaussian, of its usual width, with a linear trend."""
    from smt.surrogate_models import RBF  # noqa: PLC0415

    model = RBF(d0=1.0, poly_degree=1, print_global=False)
    model.set_training_values(x, y)
    model.train()
    return np.asarray(model.predict_values(new))


OWN: dict[str, SurrogateRules] = {
    "femtune, Kriging, constant trend": KrigingRules(),
    "femtune, Kriging, linear trend": KrigingRules("linear"),
    "femtune, Kriging, quadratic trend": KrigingRules("quadratic"),
    "femtune, Kriging, Matérn 5/2": KrigingRules(correlation="matern-5/2"),
    "femtune, quadratic response surface": KrigingRules("quadratic", "none"),
    "femtune, radial basis functions, cubic": RadialRules(),
    "femtune, radial basis functions, quintic": RadialRules("quintic"),
    "femtune, radial basis functions, thin plate": RadialRules("thin-plate"),
    "femtune, polynomial chaos": ChaosRules(),
}
OURS: dict[str, Predict] = {
    **{name: ours(rules) for name, rules in OWN.items()},
    "SciPy, radial basis functions, cubic": radial("cubic"),
    "SciPy, radial basis functions, Gaussian": radial("gaussian"),
}
OTHERS: dict[str, tuple[str, Predict]] = {
    "scikit-learn, Gaussian process": ("sklearn", scikit_learn),
    "SMT, Kriging": ("smt", smt),
    "SMT, radial basis functions, Gaussian": ("smt", smt_radial),
    "OpenTURNS, Kriging": ("openturns", openturns_kriging),
    "OpenTURNS, polynomial chaos, degree 3": ("openturns", chaos(3)),
    "OpenTURNS, polynomial chaos, degree 4": ("openturns", chaos(4)),
}


def installed() -> dict[str, Predict]:
    """All surrogates whose library is there."""
    return {**OURS, **{name: predict for name, (module, predict) in OTHERS.items() if find_spec(module) is not None}}


def versions() -> str:
    """Versions of the libraries."""
    found = []
    for name in ("scipy", "scikit-learn", "smt", "openturns", "SALib"):
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return ", ".join(found)
