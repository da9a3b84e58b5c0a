"""Messages of shapes, sensors and pairing: each is the example that its page shows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.correlation import GeneralisedSensor, correlate, map_sensors, no_pairs, pair_modes, rigid_motion_sensor
from femtune.correlation.unit_factor import unit_factor
from femtune.dofs import Dof, DofSet, parse_dof
from femtune.errors import FemtuneError, Notice
from femtune.fem.structure import NodeTable, Structure
from femtune.fem.values import ValueTable
from femtune.modal import ModeSet, cross_orthogonality, mac, rotate_to
from femtune.testdata import ModalTest, Sensor
from femtune.units import SI

_EYE = np.eye(4)
_UP = (0.0, 0.0, 1.0)


def _modes(freq_hz: list[float], shapes: np.ndarray) -> ModeSet:
    return ModeSet(np.array(freq_hz), shapes, DofSet(Dof(101 + i, "Z") for i in range(len(shapes))))


def _structure() -> Structure:
    xyz = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0, 1, 0]])
    nodes = NodeTable(np.arange(1, 6), xyz, np.tile(np.eye(3), (5, 1, 1)))
    return Structure(nodes, ValueTable((), np.zeros(0)), ())


def _test(**places: tuple[float, float, float]) -> ModalTest:
    sensors = [Sensor(parse_dof(f"{k[1:]}Z+"), np.array(p), np.array(_UP)) for k, p in places.items()]
    return ModalTest("bench", SI, sensors=tuple(sensors))


def _map(test: ModalTest, tolerance: float = 0.05, **more: object) -> tuple[Notice, ...]:
    return map_sensors(test, _structure(), tolerance=tolerance, **more).notices  # type: ignore[arg-type]


def _none_paired() -> None:
    test, model = _modes([12.0, 31.5], _EYE[:, :2]), _modes([13.1, 60.0], _EYE[:, [2, 1]])
    pairing = pair_modes(test, model)
    raise no_pairs(test, {u.test: u.reason for u in pairing.unpaired_test}, "survey.uff")


def _inverted() -> tuple[Notice, ...]:
    shapes = np.array([[1.0, 1.0], [2, -1], [3, 0.5], [2.5, 2]])
    model = _modes([10.0, 20.0], shapes)
    return correlate(_modes([10.0, 20.0], shapes * [[-0.6], [1], [1], [1]]), model).notices


def _never_cluster() -> tuple[Notice, ...]:
    modes = _modes([10.0, 10.01], _EYE[:, :2])
    return pair_modes(modes, modes, never=((0, 1),)).notices


def _crowded() -> tuple[Notice, ...]:
    return pair_modes(_modes([10.0], _EYE[:, :1]), _modes([10.0, 10.05, 10.1], _EYE[:, :3])).notices


def _exchanged() -> tuple[Notice, ...]:
    shapes = np.array([[1.0, 1.0, 0.2], [2, -1, 0.7], [3, 0.5, -1], [2.5, 2, 0.4], [-1.5, 1, 1], [0.3, -2, -0.5]])
    model = _modes([10.0, 20.0, 30.0], shapes)
    return correlate(_modes([10.0, 20.0, 30.0], shapes[[0, 3, 2, 1, 4, 5]]), model).notices


def _suspension() -> tuple[Notice, ...]:
    x = np.linspace(-1.0, 1.0, 9)
    shapes = np.column_stack([np.ones(9), x, x**2 - 0.4, x**3 - 0.6 * x])
    return correlate(_modes([1.2, 1.9, 20.0, 48.0], shapes), _modes([0.0, 0.0, 20.0, 50.0], shapes), rigid=2).notices


_CASES: dict[str, Callable[[], object]] = {
    "modal.zero-shape": lambda: mac(_EYE, _EYE * [1, 0, 1, 0]),
    "modal.rows-differ": lambda: mac(_EYE, np.eye(6)),
    "modal.missing-entries": lambda: cross_orthogonality(_EYE * np.nan, _EYE, _EYE),
    "modal.mass-not-positive": lambda: cross_orthogonality(_EYE, _EYE, np.diag([1.0, 2.0, -0.5, 1.0])),
    "modal.complex-model": lambda: rotate_to(1j * _EYE[:, :2], _EYE[:, :2]),
    "correlate.dofs-differ": lambda: pair_modes(_modes([1.0], _EYE[:, :1]), _modes([1.0], np.ones((9, 1)))),
    "correlate.fixed-pair": lambda: pair_modes(
        _modes([1.0], _EYE[:, :1]), _modes([1.0], _EYE[:, :1]), fixed=((0, 11),)
    ),
    "correlate.left-out": lambda: pair_modes(_modes([1.0], _EYE[:, :1]), _modes([1.0], _EYE[:, :1]), left_out={0: ""}),
    "correlate.gate": lambda: pair_modes(_modes([1.0], _EYE[:, :1]), _modes([1.0], _EYE[:, :1]), frequency_gate=30.0),
    "correlate.no-pairs": _none_paired,
    "correlate.crowded-cluster": _crowded,
    "correlate.never-cluster": _never_cluster,
    "correlate.sensor-inverted": _inverted,
    "correlate.sensors-exchanged": _exchanged,
    "correlate.suspension": _suspension,
    "sensor.unmatched": lambda: _map(_test(n1=(0.0, 0.0, 0.0), n7=(2.0, 0.0, 0.4))),
    "sensor.no-position": lambda: _map(
        ModalTest("bench", SI, modes=ModeSet(np.ones(1), np.ones((1, 1)), DofSet.parse(["12Z+"])))
    ),
    "sensor.given-unknown": lambda: _map(_test(n1=(0.0, 0.0, 0.0)), given={500: 1}),
    "sensor.combination-unused": lambda: _map(
        _test(n1=(0.0, 0.0, 0.0)), combinations=(GeneralisedSensor(Dof(70, "X"), ((1, 1, 1.0),)),)
    ),
    "sensor.tolerance": lambda: _map(_test(), tolerance=-1.0),
    "sensor.rigid-motion": lambda: rigid_motion_sensor(_structure(), 70, [1, 2], (0, 0, 0), "123456"),
    "sensor.components": lambda: rigid_motion_sensor(_structure(), 70, [1, 2], (0, 0, 0), "XY"),
    "sensor.tie": lambda: _map(_test(n9=(0.0, 1.0, 0.01))),
    "sensor.far-from-node": lambda: _map(_test(n2=(0.0, 0.0, 0.0)), given={2: 2}),
    "sensor.too-far": lambda: _map(_test(n2=(0.0, 0.0, 0.0)), by_id=True),
    "sensor.no-position, one place": lambda: _map(
        _test(n7=(0.0, 0, 0), n8=(0.0, 0, 0), n9=(0.0, 0, 0), n10=(0.0, 0, 0))
    ),
    "sensor.no-distance": lambda: _map(
        _test(n1=(0.0, 0, 0), n2=(0.0, 0, 0), n3=(0.0, 0, 0), n4=(0.0, 0, 0)), by_id=True
    ),
    "sensor.one-grid": lambda: _map(_test(n1=(0.0, 0, 0), n2=(0.002, 0, 0), n3=(0.002, 0.001, 0), n4=(0.0, 0.001, 0))),
    "sensor.shared-node": lambda: _map(_test(n7=(0.0, 0.0, 0.01), n8=(0.02, 0.0, 0.0))),
    "sensor.left-out": lambda: _map(_test(n1=(0.0, 0.0, 0.0), n7=(2.0, 0.0, 0.4)), leave_unmatched=True),
}


def _said(case: Callable[[], object]) -> str:
    """The text of the error that a case raises, or of the notice that it returns."""
    try:
        found = case()
    except FemtuneError as error:
        return str(error)
    assert isinstance(found, tuple)
    assert [type(n) for n in found] == [Notice]
    return str(found[0])


def _scaled() -> tuple[Notice, ...]:
    """Sensors by hand, whose coordinates are in millimetres."""
    test = _test(n1=(0.0, 0, 0), n2=(2000.0, 0, 0), n3=(2000.0, 1000.0, 0), n4=(0.0, 1000.0, 0))
    return tuple(n for n in _map(test, given={i: i for i in (1, 2, 3, 4)}) if n.code == "sensor.units")


def _factor() -> tuple[Notice, ...]:
    test, model = _modes([10.0, 17.0, 31.0], _EYE[:, :3]), _modes([318.0, 530.0, 985.0], _EYE[:, :3])
    return unit_factor(test, model, pair_modes(test, model))


_CASES |= {"sensor.units": _scaled, "correlate.unit-factor": _factor}


@pytest.mark.parametrize("code", sorted(_CASES))
def test_the_page_shows_the_message(code: str) -> None:
    check_shown(code, _said(_CASES[code]))


def test_a_unit_mistake_is_guessed() -> None:
    with pytest.raises(FemtuneError) as caught:
        _map(_test(n1=(2000.0, 0.0, 0.0), n2=(2000.0, 1000.0, 0.0), n3=(0.0, 1000.0, 0.0)))
    assert str(caught.value).endswith(
        "hint: the test's coordinates look like millimetres where the model has metres (factor 0.001)"
    )
