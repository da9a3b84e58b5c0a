"""Tables of points: places, oblique directions, and errors with their lines."""

import numpy as np
import pytest

from femtune.dofs import parse_dof
from femtune.errors import FemtuneError
from femtune.files.points_table import read_points


def table(tmp_path, text):
    (tmp_path / "points.csv").write_text(text)
    return tmp_path / "points.csv"


def test_points_with_oblique_directions_that_are_not_perpendicular(tmp_path):
    text = "node;x;y;z;X_x;X_y;X_z;Z_x;Z_y;Z_z\n11;1;2;3;3;4;0;0;3;4\n\n12;4,5;5;6;1;0;0;0;0;-2\n"
    frame = read_points(table(tmp_path, text))
    assert frame.position(12).tolist() == [4.5, 5.0, 6.0]
    assert frame.direction(parse_dof("11X-")) == pytest.approx([-0.6, -0.8, 0.0])
    assert frame.direction(parse_dof("11Z+")) == pytest.approx([0.0, 0.6, 0.8])
    assert frame.direction(parse_dof("11Y+")) == pytest.approx([0.0, 1.0, 0.0])
    assert frame.direction(parse_dof("12Z+")) == pytest.approx([0.0, 0.0, -1.0])
    assert not np.isclose(frame.direction(parse_dof("11X+")) @ frame.direction(parse_dof("11Z+")), 0.0)


@pytest.mark.parametrize(
    ("text", "says", "line"),
    [
        ("node,x,y\n1,2,3\n", "needs the columns", 1),
        ("node,x,y,z,X_x\n1,2,3,4,5\n", "three columns for each direction", 1),
        ("node,x,y,z,w\n1,2,3,4,5\n", "'w' is unknown", 1),
        ("node,x,y,z\n1,2,3,4\n2,5,6\n", "3 fields", 3),
        ("node,x,y,z\n1,2,3,4\n\n2.5,5,6,7\n", "'2.5'", 4),
        ("node;x;y;z\n1;2,5,1;3;4\n", "'2,5,1'", 2),
        ("node,x,y,z\n1,2,3,nan\n", "'nan' is not a valid number", 2),
        ("node,x,y,z,X_x,X_y,X_z\n1,2,3,4,0,0,0\n", "direction X has no length", 2),
        ("node,x,y,z\n", "has 1 lines", None),
        ("", "has 0 lines", None),
        ("node,x,y,z\n1,0,0,0\n1,0,0,1\n", "node 1 twice, first in line 2", 3),
        ("node,x,y,z\n1,0,a,0\n1,0,0,1\n2,0,b,0\n", "2 problems", None),
        ("node,x\x00y", "binary file", None),
    ],
)
def test_what_cannot_be_read_is_told_with_its_line(tmp_path, text, says, line):
    with pytest.raises(FemtuneError, match=says) as caught:
        read_points(table(tmp_path, text))
    if line:
        assert caught.value.where.line == line
