"""What a user reads when set-ups cannot be merged, or sensors do not move with their rigid body."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError, Notice
from femtune.files.identification_file import IdentifyFile, read_identify_file
from femtune.files.points_table import read_points
from femtune.identification.setups import PartlyFound, merge_setups
from femtune.modal import Channel, ModeSet, TimeSeries
from femtune.steps.identify import setups
from femtune.steps.identify.choices import read_choices
from femtune.steps.identify.identified import Curve, Found
from femtune.steps.identify.rigid_bodies import with_rigid_bodies

NOTHING = np.zeros(0)
EMPTY = Found(
    ModeSet(NOTHING, np.zeros((1, 0)), DofSet([Dof(1, "Z")])), NOTHING, None, (), {}, Curve(NOTHING, NOTHING, "")
)
FLOOR = '[[rigid_body]]\nnode = 1\nsensors = ["11X+", "12X+", "12Y+", "13Y+"]\n'


def described(folder: Path, text: str) -> IdentifyFile:
    (folder / "identify.toml").write_text('[identify]\nrecord = "a.csv"\nband_hz = [1, 5]\n' + text)
    return read_identify_file(folder / "identify.toml")


def floor_record(sign: float) -> TimeSeries:
    x, y, turn = np.random.default_rng(0).standard_normal((3, 400))
    values = np.array([x, x - 3.0 * turn, y + 4.0 * turn, sign * y])
    places = [(11, "X"), (12, "X"), (12, "Y"), (13, "Y")]
    return TimeSeries(values, tuple(Channel(Dof(n, d), "acceleration") for n, d in places), 50.0)


def test_a_sensor_that_does_not_move_with_its_floor(tmp_path: Path) -> None:
    file = described(tmp_path, FLOOR)
    (tmp_path / "points.csv").write_text("node,x,y,z\n1,0,0,0\n11,0,0,0\n12,4,3,0\n13,0,3,0\n")
    geometry = read_points(tmp_path / "points.csv")
    made, notices = with_rigid_bodies(floor_record(1.0), file, geometry)
    assert not notices
    assert made.dofs().labels() == ["1X+", "1Y+", "1RZ+"]
    _, (notice,) = with_rigid_bodies(floor_record(-1.0), file, geometry)
    check_shown("identify.rigid-bodies", str(notice).replace(f"{tmp_path}/", ""))


def test_a_floor_without_places(tmp_path: Path) -> None:
    with pytest.raises(FemtuneError) as caught:
        with_rigid_bodies(floor_record(1.0), described(tmp_path, FLOOR), None)
    check_shown("identify.rigid-bodies, no geometry", str(caught.value).replace(f"{tmp_path}/", ""))


def test_a_setup_without_a_measurement(tmp_path: Path) -> None:
    with pytest.raises(FemtuneError) as caught:
        described(tmp_path, '[[setup]]\nrecord = "b.csv"\n')
    check_shown("identify.setup-source", str(caught.value).replace(f"{tmp_path}/", ""))


def test_modes_of_some_setups() -> None:
    (notice,) = setups.left_notice([PartlyFound(4.321, (0, 2))], 5)
    check_shown("identify.setups-left", str(notice))


def test_a_mode_that_does_not_move_at_the_reference() -> None:
    shapes = np.array([[1.0, 0.5], [0.3, 1.0]])
    still = shapes * [[1.0, 0.0], [1.0, 1.0]]
    hz = np.array([2.0, 3.0])
    first, second = (ModeSet(hz, s, DofSet.parse(["1X+", f"{n}X+"])) for s, n in ((shapes, 2), (still, 3)))
    with pytest.raises(FemtuneError) as caught:
        merge_setups([first, second])
    check_shown("identify.setups", str(caught.value))


def test_a_choice_of_poles_for_a_file_that_has_changed(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("1\n2\n", encoding="utf-8")
    text = f'[[input]]\npath = "a.csv"\nsha256 = "{64 * "0"}"\n'
    mode = '[[mode]]\nmethod = "N4SID"\norder = 4\nfreq_hz = 3.0\ndamping_ratio = 0.01\n'
    (tmp_path / "choices.toml").write_text(text + mode, encoding="utf-8")
    with pytest.raises(FemtuneError) as caught:
        read_choices(tmp_path / "choices.toml", [tmp_path / "a.csv"])
    check_shown("identify.choices", caught.value.at(None))


def test_what_was_refined_in_set_ups_is_one_sentence() -> None:
    told = Notice("identify.likelihood", level="info", refined=3, count=3)
    partly = Notice("identify.likelihood/partly", level="info", refined=2, count=4, others="4.16, 9.3")
    two = Notice("identify.likelihood/divided", level="info", frequencies="3.91")
    each = [replace(EMPTY, notices=notices) for notices in ((told,), (partly, two), (), (told,))]
    (notice,) = setups.likelihood_notice(["a", "b", "c", "d"], each)
    check_shown("identify.likelihood, setups", notice)
    (whole,) = setups.likelihood_notice(["a", "d"], [each[0], each[3]])
    assert "6 of 6 modes" in whole.what
    assert "(" not in whole.what
    assert setups.likelihood_notice(["c"], [each[2]]) == ()
    many = setups.likelihood_notice([str(i) for i in range(9)], [each[1]] * 9)[0]
    assert many.what.endswith("set-up 4: 2 of 4, two modes near 3.91 Hz; and 4 more set-ups)")
