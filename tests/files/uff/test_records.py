"""Single data sets, written out by hand, with what they must give."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.dofs import parse_dof
from femtune.errors import FemtuneError
from femtune.files.uff import UffContent, UffFile, read_uff, scan_uff
from femtune.units import SI, UnitSystem, unit_system


def block(number: str, *lines: str) -> str:
    return "\n".join(["    -1", f"{number:>6}", *lines, "    -1", ""])


def node(number: int, system: int, displacement: int, x: float, y: float, z: float) -> str:
    return f"{number:10d}{system:10d}{displacement:10d}{1:10d}{x:13.5E}{y:13.5E}{z:13.5E}"


def mode(*data: str, number: int = 1, head: tuple[int, ...] = (1, 2, 2, 8, 2, 3), reals: str = "") -> str:
    ids = ["BC", "NONE", "NONE", "NONE", "NONE"]
    parameters = "".join(f"{value:10d}" for value in head)
    counts = f"{2:10d}{4:10d}{1:10d}{number:10d}"
    return block("55", *ids, parameters, counts, reals or singles(5.0, 0.0, 0.0, 0.0), *data)


def singles(*values: float) -> str:
    return "".join(f"{value:13.5E}" for value in values)


def read(tmp_path: Path, text: str, *, units: UnitSystem = SI, stated: UnitSystem | None = SI) -> UffContent:
    path = tmp_path / "a.uff"
    path.write_text(text, encoding="utf-8")
    return read_uff(path, units=units, file_units=stated)


def refused(tmp_path: Path, text: str, stated: UnitSystem | None = SI) -> FemtuneError:
    with pytest.raises(FemtuneError) as caught:
        read(tmp_path, text, stated=stated)
    return caught.value


UNITS_MM = block(
    "164", f"{5:10d}{'mm (milli-newton)':<20}{2:10d}", f"{'1.D+03':>25}{'1.D+03':>25}{'1.D+00':>25}", "2.7D+02"
)
UNITS_LBF = block("164", f"{7:10d}{'inch':<20}{2:10d}", "  3.937007874D+01  2.248089431D-01  1.0D+00", "  0.0D+00")
NODE = block("15", node(1, 0, 0, 1.0, 2.0, 3.0))


def test_units_of_data_set_164(tmp_path: Path) -> None:
    content = read(tmp_path, UNITS_MM + NODE, stated=None)
    assert content.test.geometry.position(1) == pytest.approx([1e-3, 2e-3, 3e-3])
    assert (content.file_units.length, content.file_units.force) == pytest.approx((1e-3, 1e-3))
    slinch = unit_system("in-slinch-s")
    content = read(tmp_path, UNITS_LBF + NODE, units=slinch, stated=slinch)
    assert content.test.geometry.position(1) == pytest.approx([1.0, 2.0, 3.0], rel=1e-6)
    assert content.file_units.mass == pytest.approx(slinch.mass, rel=1e-6)


def test_units_must_be_said_and_agree(tmp_path: Path) -> None:
    assert refused(tmp_path, NODE, None).code == "uff.no-units"
    assert refused(tmp_path, UNITS_MM + NODE, unit_system("mm-t-s")).code == "uff.units-contradict"
    assert refused(tmp_path, UNITS_MM + UNITS_LBF + NODE, None).code == "uff.units-contradict"
    zero = UNITS_MM.replace("1.D+03", "0.D+00", 1)
    assert refused(tmp_path, zero + NODE, None).code == "uff.value"


def test_a_code_that_contradicts_its_factors_is_noticed(tmp_path: Path) -> None:
    content = read(tmp_path, UNITS_MM.replace("         5mm", "         1mm") + NODE, stated=None)
    assert [n.code for n in content.notices] == ["uff.units-code"]


def system_18(number: int, kind: int, *points: float, reference: int = 0) -> list[str]:
    head = f"{number:10d}{kind:10d}{reference:10d}{1:10d}{1:10d}"
    return [head, f"CS{number}", singles(*points[:6]), singles(*points[6:])]


TURNED = system_18(4, 0, 10, 0, 0, 10, 1, 0, 10, 0, 1)
"""Origin (10, 0, 0), x along global y, z along global z."""


def test_cartesian_system_moves_nodes_and_turns_directions(tmp_path: Path) -> None:
    text = block("18", *TURNED) + block("15", node(1, 4, 4, 1.0, 2.0, 3.0), node(2, 0, 0, 0, 0, 0))
    frame = read(tmp_path, text).test.geometry
    # y of the system is z × x = −(global x)
    assert frame.position(1) == pytest.approx([8.0, 1.0, 3.0])
    assert frame.direction(parse_dof("1X+")) == pytest.approx([0, 1, 0])
    assert frame.direction(parse_dof("1RY-")) == pytest.approx([1, 0, 0])
    assert frame.direction(parse_dof("2X+")) == pytest.approx([1, 0, 0])


def test_system_in_a_system(tmp_path: Path) -> None:
    inner = system_18(5, 0, 1, 0, 0, 2, 0, 0, 1, 0, 1, reference=4)
    text = block("18", *TURNED, *inner) + block("15", node(1, 5, 5, 1.0, 0.0, 0.0))
    frame = read(tmp_path, text).test.geometry
    assert frame.position(1) == pytest.approx([10.0, 2.0, 0.0])
    assert frame.direction(parse_dof("1X+")) == pytest.approx([0, 1, 0])


def test_cylindrical_system(tmp_path: Path) -> None:
    cylinder = system_18(4, 1, 0, 0, 0, 1, 0, 0, 1, 0, 1)
    frame = read(tmp_path, block("18", *cylinder) + block("15", node(1, 4, 4, 2.0, 90.0, 5.0))).test.geometry
    assert frame.position(1) == pytest.approx([0.0, 2.0, 5.0])
    assert frame.direction(parse_dof("1X+")) == pytest.approx([0, 1, 0])
    assert frame.direction(parse_dof("1Y+")) == pytest.approx([-1, 0, 0])


@pytest.mark.parametrize(
    "system",
    [
        system_18(4, 2, 0, 0, 0, 1, 0, 0, 1, 0, 1),
        system_18(4, 0, 0, 0, 0, 1, 0, 0, 2, 0, 0),
        system_18(4, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0),
        system_18(4, 0, 0, 0, 0, 1, 0, 0, 1, 0, 1, reference=9),
        system_18(5, 0, 0, 0, 0, 1, 0, 0, 1, 0, 1),
        [*TURNED, *system_18(4, 0, 0, 0, 0, 1, 0, 0, 1, 0, 1)],
    ],
    ids=["spherical", "points on a line", "points that coincide", "unknown reference", "not defined", "twice"],
)
def test_systems_that_cannot_be_used(tmp_path: Path, system: list[str]) -> None:
    first = block("18", *system[:4]) + (block("18", *system[4:]) if system[4:] else "")
    assert refused(tmp_path, first + block("15", node(1, 0, 4, 1, 2, 3))).code == "uff.coordinate-system"


def test_left_handed_2420_is_refused(tmp_path: Path) -> None:
    rows = ["1.0D+00 0.0D+00 0.0D+00", "0.0D+00 -1.0D+00 0.0D+00", "0.0D+00 0.0D+00 1.0D+00", "0. 0. 0."]
    text = block("2420", f"{1:10d}", "part", f"{4:10d}{0:10d}{1:10d}", "CS", *rows)
    assert refused(tmp_path, text + NODE).code == "uff.coordinate-system"


def test_system_1_is_global_when_not_defined(tmp_path: Path) -> None:
    content = read(tmp_path, block("15", node(1, 1, 1, 1, 2, 3)))
    assert [n.code for n in content.notices] == ["uff.global-system"]
    assert content.test.geometry.position(1) == pytest.approx([1, 2, 3])


def test_elements_of_many_nodes_and_beams(tmp_path: Path) -> None:
    nodes = block("15", *(node(k, 0, 0, k, 0, 0) for k in range(1, 11)))
    numbers = "".join(f"{k:10d}" for k in range(1, 9))
    tetra = [f"{1:10d}{118:10d}{1:10d}{1:10d}{1:10d}{10:10d}", numbers, f"{9:10d}{10:10d}"]
    beam = [f"{2:10d}{21:10d}{1:10d}{1:10d}{1:10d}{2:10d}", f"{0:10d}{1:10d}{1:10d}", f"{3:10d}{5:10d}"]
    lost = [f"{3:10d}{41:10d}{1:10d}{1:10d}{1:10d}{3:10d}", f"{3:10d}{5:10d}{77:10d}"]
    content = read(tmp_path, nodes + block("2412", *tetra, *beam, *lost))
    assert content.test.geometry.elements == (tuple(range(1, 11)), (3, 5))
    assert [n.code for n in content.notices] == ["uff.unknown-node"]
    assert refused(tmp_path, nodes + block("2412", *tetra[:2])).code == "uff.truncated"


def test_trace_line_longer_than_declared(tmp_path: Path) -> None:
    nodes = block("15", node(1, 0, 0, 0, 0, 0), node(2, 0, 0, 1, 0, 0))
    head, name = f"{1:10d}{2:10d}{1:10d}", "line"
    good = block("82", head, name, f"{1:10d}{2:10d}{0:10d}")
    assert read(tmp_path, nodes + good).test.geometry.lines == ((1, 2),)
    assert refused(tmp_path, nodes + block("82", head, name, f"{1:10d}{2:10d}{1:10d}")).code == "uff.count"
    assert refused(tmp_path, nodes + block("82", head, name, f"{1:10d}")).code == "uff.truncated"


def test_node_twice(tmp_path: Path) -> None:
    """Repeated geometry is read once; another place is an error, and a number twice in one data set too."""
    assert len(read(tmp_path, NODE + NODE).test.geometry) == 1
    assert refused(tmp_path, NODE + NODE.replace("1.0", "1.1", 1)).code == "uff.duplicate-node"
    line = NODE.splitlines()[2]
    assert refused(tmp_path, NODE.replace(line, f"{line}\n{line}")).code == "uff.duplicate-node"


def test_a_test_in_several_files(tmp_path: Path) -> None:
    whole = NODE + mode(f"{1:10d}", singles(1.0, 0.0, -0.5))
    (tmp_path / "a.uff").write_text(NODE)
    (tmp_path / "b.uff").write_text(whole)
    (tmp_path / "c.uff").write_text(NODE.replace("1.0", "1.1", 1))
    test = read_uff(UffFile(tmp_path / "a.uff", (tmp_path / "b.uff",)), units=SI, file_units=SI).test
    assert test.modes is not None
    assert (len(test.geometry), test.modes.shapes[:, 0].tolist()) == (1, [1.0, -0.5])
    with pytest.raises(FemtuneError, match="node") as caught:
        read_uff(UffFile(tmp_path / "b.uff", (tmp_path / "c.uff",)), units=SI, file_units=SI)
    assert "c.uff" in str(caught.value.where)


VALUES = [f"{1:10d}", singles(1.0, 0.0, -0.5), f"{2:10d}", singles(0.25, 0.0, 2.0)]


def test_damping_and_modal_mass(tmp_path: Path) -> None:
    def modes(*reals: float) -> tuple[object, str]:
        found = read(tmp_path, mode(*VALUES, reals=singles(*reals))).test.modes
        assert found is not None
        return (None if found.damping_ratio is None else found.damping_ratio.tolist()), found.normalisation

    assert modes(5.0, 1.0, 0.02, 0.0) == ([0.02], "mass")
    # The loss factor of hysteretic damping is twice the viscous ratio at resonance.
    assert modes(5.0, 0.0, 0.0, 0.02) == ([0.01], "unknown")
    assert modes(5.0, 3.0, 0.0, 0.0) == (None, "unknown")


def test_damping_of_some_modes_only(tmp_path: Path) -> None:
    text = mode(*VALUES, reals=singles(5, 0, 0.01, 0)) + mode(*VALUES, number=2)
    content = read(tmp_path, text)
    assert content.test.modes is not None
    assert content.test.modes.damping_ratio is None
    assert "uff.damping" in [n.code for n in content.notices]


def test_component_that_is_zero_in_one_mode_only_stays(tmp_path: Path) -> None:
    other = [f"{2:10d}", singles(0.0, 0.0, 1.0), f"{1:10d}", singles(0.0, 0.5, 0.0)]
    found = read(tmp_path, mode(*VALUES) + mode(*other, number=2)).test.modes
    assert found is not None
    assert found.dofs.labels() == ["1X+", "1Y+", "1Z+", "2X+", "2Z+"]
    # The second mode lists its nodes in another order.
    np.testing.assert_array_equal(found.shapes[:, 1], [0.0, 0.5, 0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (mode(*VALUES) + mode(*VALUES), "uff.repeated-mode"),
        (mode(*VALUES) + mode(*VALUES[:2], number=2), "uff.modes-differ"),
        (mode(*VALUES[:2], *VALUES[:2]), "uff.duplicate-node"),
        (mode(*VALUES[:3]), "uff.truncated"),
        (mode(VALUES[0], singles(1.0, 2.0)), "uff.truncated"),
        (mode(VALUES[0], singles(1.0, 2.0, 3.0, 4.0)), "uff.count"),
        (mode(VALUES[0], "  1.00000E+00          NaN  2.00000E+00"), "uff.value"),
        (mode(VALUES[0], "  1.00000E+00 1.00000E+999  2.00000E+00"), "uff.value"),
        (mode(VALUES[0], singles(0.0, 0.0, 0.0)), "uff.no-dofs"),
        (mode(*VALUES, head=(1, 2, 2, 8, 2, 6)), "uff.count"),
        (mode(*VALUES, reals=singles(-5, 0, 0, 0)), "uff.value"),
        (mode(*VALUES, head=(1, 3, 2, 8, 2, 3), reals=singles(0, 0, 0, 0)), "uff.pole"),
    ],
)
def test_modes_that_are_refused(tmp_path: Path, text: str, code: str) -> None:
    assert refused(tmp_path, text).code == code


@pytest.mark.parametrize("head", [(1, 5, 2, 8, 2, 3), (1, 2, 4, 2, 2, 6), (1, 2, 2, 3, 2, 3)])
def test_other_55s_are_listed(tmp_path: Path, head: tuple[int, ...]) -> None:
    content = read(tmp_path, mode(*VALUES) + mode(*VALUES, number=2, head=head))
    assert content.test.modes is not None
    assert len(content.test.modes) == 1
    assert [n.code for n in content.notices if n.code == "uff.not-a-mode"]


def test_fortran_exponents(tmp_path: Path) -> None:
    found = read(tmp_path, mode(VALUES[0], "  1.00000D+00 -2.0000-100  1.00000d-01")).test.modes
    assert found is not None
    assert found.shapes[:, 0].tolist() == [1.0, -2e-100, 0.1]


def test_unknown_data_sets_are_listed_with_line_and_count(tmp_path: Path) -> None:
    notices = read(tmp_path, NODE + block("9999", "x") + block("9999", "y")).notices
    assert [(n.code, n.level) for n in notices] == [("uff.ignored", "warning")]
    assert "2 of them" in notices[0].what
    assert notices[0].where is not None
    assert notices[0].where.line == 5


def test_scan_gives_lines(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    path.write_text(NODE + block("9999", "x", "y"))
    assert [(s.number, s.line, len(s.lines)) for s in scan_uff(path)] == [(15, 1, 1), (9999, 5, 2)]


def test_frame_of_the_file(tmp_path: Path) -> None:
    cases = {
        "uff.outside": NODE + NODE.partition("\n")[2],
        "uff.syntax": "    -1\n" + NODE,
        "uff.truncated": NODE + "    -1\n",
        "uff.not-uff": "1 2 3\n",
    }
    for code, text in cases.items():
        assert refused(tmp_path, text).code == code
    with pytest.raises(FemtuneError) as caught:
        scan_uff(tmp_path / "absent.uff")
    assert caught.value.code == "uff.no-file"


def frf(response: int = 1, kind: int = 12, label: str = "m/s2", force: str = "N", step: float = 1.0) -> str:
    axis = "{:10d}    0    0    0 NONE                 {:<20}"
    return block(
        "58",
        *["NONE"] * 5,
        f"{4:5d}{0:10d}{0:5d}{0:10d} NONE      {response:10d}{3:4d} NONE      {2:10d}{-1:4d}",
        f"{5:10d}{3:10d}{1:10d}{1.0:13.5E}{step:13.5E}{0.0:13.5E}",
        axis.format(18, "Hz"),
        axis.format(kind, label),
        axis.format(13, force),
        axis.format(0, "NONE"),
        singles(1, 2, 3, 4, 5, 6),
    )


@pytest.mark.parametrize(("kind", "name"), [(8, "receptance"), (11, "mobility"), (12, "accelerance")])
def test_kinds_of_frf(tmp_path: Path, kind: int, name: str) -> None:
    frfs = read(tmp_path, frf(kind=kind, label="NONE")).test.frfs
    assert frfs is not None
    assert frfs.kind == name
    assert frfs.responses.labels() + frfs.references.labels() == ["1Z+", "2X-"]
    assert frfs.values[0, 0].tolist() == [1 + 2j, 3 + 4j, 5 + 6j]
    assert frfs.freq_hz.tolist() == [1.0, 2.0, 3.0]


def test_frfs_of_two_kinds_or_lines_stay_apart(tmp_path: Path) -> None:
    for other in (frf(2, kind=11, label="m/s"), frf(2, step=0.5)):
        content = read(tmp_path, frf(1) + other)
        assert content.test.frfs is None
        assert [len(one.responses) for one in content.frf_sets] == [1, 1]
        assert "uff.several-frf-sets" in [n.code for n in content.notices]


def test_frf_twice(tmp_path: Path) -> None:
    assert refused(tmp_path, frf() + frf()).code == "uff.duplicate-frf"


def test_padding_must_be_zero(tmp_path: Path) -> None:
    content = read(
        tmp_path, frf().replace("    -1\n", singles(0, 0) + "\n    -1\n").replace(singles(0, 0) + "\n", "", 1)
    )
    assert content.test.frfs is not None
    assert content.test.frfs.values.shape == (1, 1, 3)
    assert "uff.padding" in [n.code for n in content.notices]
    longer = frf().rstrip().removesuffix("    -1").rstrip() + "\n" + singles(7, 8) + "\n    -1\n"
    assert refused(tmp_path, longer).code == "uff.count"


def test_modal_mass_does_not_scale_velocities(tmp_path: Path) -> None:
    for specific, wanted in ((8, "mass"), (11, "unknown"), (12, "unknown")):
        text = mode(*VALUES, head=(1, 2, 2, specific, 2, 3), reals=singles(5, 1, 0, 0))
        modes = read(tmp_path, text).test.modes
        assert modes is not None
        assert modes.normalisation == wanted


@pytest.mark.parametrize("bad", ["          nan", "        1_000.", "          inf", "  1.00000E+999", "         0x1f"])
def test_a_point_that_is_no_number(tmp_path: Path, bad: str) -> None:
    error = refused(tmp_path, frf().replace(singles(3.0), bad[-13:]))
    assert (error.code, error.where and error.where.line) == ("uff.value", 14)
