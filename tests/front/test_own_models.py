"""`ft.own_model`: a Python function or an object as the model, with and without derivatives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg as la
from tests.messages.shown import check_shown

import femtune as ft
from femtune.testing import check_own_model

DOFS = ["1Z", "2Z-", "3Z"]
SIGNS = np.array([[1.0], [-1.0], [1.0]])
TRUE = {"k1": 12e3, "k2": 9e3, "k3": 15e3}
SD = 0.01
Modes = tuple[np.ndarray, np.ndarray]


def stiffness(k: dict[str, float]) -> np.ndarray:
    a, b, c = (k[name] for name in TRUE)
    return np.array([[a + b, -b, 0.0], [-b, b + c, -c], [0.0, -c, c]])


class Chain:
    def modes(self, values: dict[str, float]) -> Modes:
        eigenvalues, shapes = la.eigh(stiffness(values))
        return np.sqrt(eigenvalues) / (2.0 * np.pi), SIGNS * shapes

    def derivatives(self, values: dict[str, float]) -> Any:
        hz, shapes = self.modes(values)
        eigenvalues, out = (2.0 * np.pi * hz) ** 2, {}
        gap = eigenvalues[None, :] - eigenvalues[:, None]
        np.fill_diagonal(gap, np.inf)
        for name in values:
            unit = (SIGNS * shapes).T @ stiffness({k: float(k == name) for k in TRUE}) @ (SIGNS * shapes)
            out[name] = np.diag(unit) / (8.0 * np.pi**2 * hz), shapes @ (unit / gap)
        return out


def parameters() -> list[ft.Parameter]:
    return [ft.Parameter(name, lower=5e3, upper=2e4, nominal=1e4, absolute=True) for name in TRUE]


def update(model: ft.Model, test: ft.ModalTest, folder: Path) -> Any:
    residuals = [ft.FrequencyResidual(sd=SD)]
    return ft.update(model, test, parameters=parameters(), residuals=residuals, output=folder)


def expected_sd() -> np.ndarray:
    """Linear standard deviations of the three parameters from three frequencies."""
    hz = Chain().modes(TRUE)[0]
    slopes = Chain().derivatives(TRUE)
    jacobian = np.stack([slopes[name][0] / hz / SD for name in TRUE], axis=1)
    return np.sqrt(np.diag(la.inv(jacobian.T @ jacobian)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "with_shapes"),
    [(lambda v: Chain().modes(v)[0], False), (Chain().modes, True), (Chain(), True)],
    ids=["frequencies", "shapes", "derivatives"],
)
def test_the_parameters_of_a_function_are_found_with_their_standard_deviations(
    model: Any, with_shapes: bool, tmp_path: Path
) -> None:
    hz, shapes = Chain().modes(TRUE)
    dofs = DOFS if with_shapes else None
    own = ft.own_model(model, count=3, dofs=dofs, units="m-kg-s")
    found = update(own, ft.modal_test(hz, shapes if with_shapes else None, dofs=dofs), tmp_path)
    assert [row.value for row in found.parameters] == pytest.approx(list(TRUE.values()), rel=1e-6)
    assert [row.sd for row in found.parameters] == pytest.approx(list(expected_sd()), rel=2e-3)


@pytest.mark.slow
def test_derivatives_save_calls(tmp_path: Path) -> None:
    class Counted(Chain):
        def __init__(self) -> None:
            self.points: list[tuple[float, ...]] = []

        def modes(self, values: dict[str, float]) -> Modes:
            self.points.append(tuple(values.values()))
            return super().modes(values)

        def derivatives(self, values: dict[str, float]) -> Any:
            return Chain().derivatives(values)

    hz, shapes = Chain().modes(TRUE)
    given, without = Counted(), Counted()
    test = ft.modal_test(hz, shapes, dofs=DOFS)
    for name, model in (("given", given), ("without", without.modes)):
        update(ft.own_model(model, count=3, dofs=DOFS, units="m-kg-s"), test, tmp_path / name)
    assert len(given.points) < len(without.points) / 2


@pytest.mark.slow
def test_runs_are_used_again_only_with_a_version(tmp_path: Path) -> None:
    calls = 0

    def model(values: dict[str, float]) -> np.ndarray:
        nonlocal calls
        calls += 1
        return Chain().modes(values)[0]

    test, counts = ft.modal_test(Chain().modes(TRUE)[0]), []
    for version in ("", "", "1", "1"):
        calls = 0
        update(ft.own_model(model, count=3, units="m-kg-s", version=version), test, tmp_path)
        counts.append(calls)
    assert counts[0] == counts[1] == counts[2] > 10
    assert counts[3] == 0


@pytest.mark.slow
def test_the_steps_take_a_model_of_ones_own(tmp_path: Path) -> None:
    hz, shapes = Chain().modes(TRUE)
    study = ft.Study(
        model=ft.own_model(Chain(), count=3, dofs=DOFS, units="m-kg-s"),
        test=ft.modal_test(hz, shapes, dofs=DOFS),
        parameters=parameters(),
        residuals=[ft.FrequencyResidual(sd=SD)],
        output=tmp_path,
    )
    assert ft.modes(study).freq_hz == pytest.approx(Chain().modes(dict.fromkeys(TRUE, 1e4))[0])
    assert [row.mac for row in ft.correlate(study).pairs] == pytest.approx([1.0] * 3, abs=0.1)
    assert len(ft.select(study).singular_values) == 3
    assert (tmp_path / "report.html").exists() or ft.run(study).folder == tmp_path


def test_the_check_finds_a_wrong_derivative() -> None:
    class Wrong(Chain):
        def __init__(self, part: int) -> None:
            self.part = part

        def derivatives(self, values: dict[str, float]) -> Any:
            out = super().derivatives(values)
            out["k2"] = tuple(array * (1.001 if i == self.part else 1.0) for i, array in enumerate(out["k2"]))
            return out

    check_own_model(ft.own_model(Chain(), count=3, dofs=DOFS), TRUE)
    for part, word in enumerate(("frequencies", "shapes")):
        with pytest.raises(AssertionError, match=f"derivatives of {word} by k2"):
            check_own_model(ft.own_model(Wrong(part), count=3, dofs=DOFS), TRUE)
    with pytest.raises(AssertionError, match="no method derivatives"):
        check_own_model(ft.own_model(Chain().modes, count=3, dofs=DOFS), TRUE)


HZ = Chain().modes(TRUE)[0]


def slopes(given: Any) -> Any:
    class Given(Chain):
        def derivatives(self, values: dict[str, float]) -> Any:
            return given

    return Given()


SHAPE = np.ones((3, 3))
WRONG: dict[str, tuple[Any, Any, tuple[str, ...]]] = {
    "a class": (Chain, DOFS, ("call.argument", "'model'", "type")),
    "a number": (3, None, ("call.argument", "'model'", "int")),
    "two arguments": (lambda a, b: HZ, None, ("external.own-model", "'b'")),
    "None": (lambda v: None, None, ("external.own-model", "NoneType", "frequencies")),
    "a matrix": (lambda v: SHAPE, None, ("external.own-model", "(3, 3)", "(m,)")),
    "complex": (lambda v: HZ + 0j, None, ("external.own-model", "complex128")),
    "shapes of other rows": (lambda v: (HZ, np.ones((2, 3))), DOFS, ("external.own-model", "(2, 3)", "(3, 3)")),
    "no shapes": (lambda v: HZ, DOFS, ("external.own-model", "shapes", "(3, 3)")),
    "shapes without dofs": (lambda v: (HZ, SHAPE), None, ("external.own-model", "dofs=")),
    "scalar points": (Chain(), ["1S", "2S", "3S"], ("external.own-model", "scalar points")),
    "too few": (lambda v: HZ[:2], None, ("external.failed", "2 modes where 3", "k1 = 10000")),
    "NaN": (lambda v: HZ * np.nan, None, ("external.failed", "mode 1 is not a number")),
    "descending": (lambda v: HZ[::-1], None, ("external.failed", "do not ascend")),
    "an exception": (lambda v: v["k9"], None, ("external.failed", "KeyError: 'k9'")),
    "derivatives as a list": (slopes([1.0]), DOFS, ("external.own-model", "list", "mapping")),
    "derivatives without a parameter": (slopes({"k1": (HZ, SHAPE)}), DOFS, ("external.own-model", "'k2'")),
    "derivatives of two modes": (slopes(dict.fromkeys(TRUE, (HZ[:2], SHAPE))), DOFS, ("external.own-model", "(2,)")),
    "derivatives of no shapes": (slopes(dict.fromkeys(TRUE, HZ)), DOFS, ("external.own-model", "shapes by k1")),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_model_that_does_not_fit_is_told_what_it_must_return(name: str, tmp_path: Path) -> None:
    model, dofs, told = WRONG[name]
    with pytest.raises(ft.FemtuneError) as caught:
        update(ft.own_model(model, count=3, dofs=dofs, units="m-kg-s"), ft.modal_test(HZ), tmp_path)
    assert [text for text in told if text not in str(caught.value)] == []
    check_shown(f"{caught.value.code}, own model, {name}", caught.value)


def test_a_function_has_no_structure() -> None:
    with pytest.raises(ft.FemtuneError) as caught:
        ft.own_model(Chain(), count=3, dofs=DOFS).structure  # noqa: B018  refused
    check_shown("external.own-model, no structure", caught.value)


def test_a_function_without_parameters_is_refused() -> None:
    for step in (ft.modes, ft.info):
        with pytest.raises(ft.FemtuneError) as caught:
            step(ft.own_model(Chain(), count=3, dofs=DOFS, units="m-kg-s"))
        assert caught.value.code == "study.no-parameters"
    check_shown("study.no-parameters, own model", caught.value)
