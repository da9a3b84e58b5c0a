"""Files as programs write them that do not keep to the format: read, with a notice, and nothing lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.files.uff import UffContent, read_uff, scan_uff
from femtune.files.uff.function_units import StatedOfFunctions
from femtune.files.uff.scan import is_universal, names_universal
from femtune.units import SI, UnitSystem, unit_system

HZ = 2.0 + 0.5 * np.arange(20)
OMEGA = 2.0 * np.pi * HZ
POLES = ((5.0, 0.02, 0.7), (9.0, 0.01, 0.4))
ACCELERANCE = sum(
    -(OMEGA**2) * size / ((2 * np.pi * f) ** 2 - OMEGA**2 + 4j * np.pi * f * zeta * OMEGA) for f, zeta, size in POLES
)
"""At a driving point, for unit modal masses."""


def block(number: str, *lines: str) -> str:
    return "\n".join(["    -1", f"{number:>6}", *lines, "    -1", ""])


def singles(*values: float) -> list[str]:
    texts = [f"{value:13.5E}" for value in values]
    return ["".join(texts[i : i + 6]) for i in range(0, len(texts), 6)]


def pairs(values: np.ndarray) -> list[float]:
    return np.column_stack([values.real, values.imag]).ravel().tolist()


def head(
    kinds: tuple[int, int, int] = (18, 12, 13), labels: tuple[str, str, str] = ("Hz", "m/s2", "N"), *,
    response: int = 3, value_type: int = 5, start: float = HZ[0], step: float = 0.5,
) -> list[str]:  # fmt: skip
    axes = [f"{kind:10d}    0    0    0 {'NONE':<20} {label:<20}" for kind, label in zip(kinds, labels)]
    return [
        *["NONE"] * 5,
        f"{4:5d}{0:10d}{0:5d}{0:10d} NONE      {response:10d}{3:4d} NONE      {3:10d}{3:4d}",
        f"{value_type:10d}{len(HZ):10d}{1:10d}{start:13.5E}{step:13.5E}{0.0:13.5E}",
        *axes, axes[0].replace(f"{kinds[0]:10d}", f"{0:10d}").replace(labels[0], "NONE"),
    ]  # fmt: skip


def frf(values: np.ndarray = ACCELERANCE, **more: object) -> str:
    return block("58", *head(**more), *singles(*pairs(values)))  # type: ignore[arg-type]


UNITS = block("164", f"{1:10d}{'SI: Meter (newton)':<20}{2:10d}", " 1.0D+00 1.0D+00 1.0D+00", " 2.7D+02")
NODES = block("15", *(f"{n:10d}{0:10d}{0:10d}{1:10d}" + singles(float(n), 0.0, 0.0)[0] for n in (3, 5)))
FILE = UNITS + NODES + frf() + frf(0.5 * ACCELERANCE, response=5)


def mode(
    number: int, freq_hz: float, *, data_set: str = "55", nodes: tuple[int, ...] = (3, 5, 7), note: str = ""
) -> str:
    values = [line for n in nodes for line in (f"{n:10d}", singles(1.0, freq_hz, -0.5 * n)[0])]
    if data_set == "55":
        ids = ["BC", note, "NONE", "NONE", "NONE"]
        counts = [f"{2:10d}{4:10d}{1:10d}{number:10d}", singles(freq_hz, 1.0, 0.01, 0.0)[0]]
        return block("55", *ids, f"{1:10d}{2:10d}{2:10d}{8:10d}{2:10d}{3:10d}", *counts, *values)
    top = [f"{number:10d}", "MODE", f"{1:10d}", "BC", note, "NONE", "NONE", "NONE"]
    integers = ["".join(f"{i:10d}" for i in (0, 0, 1, 0, 0, number, 0, 0)), f"{0:10d}{0:10d}"]
    reals = [*singles(0.0, freq_hz, 0.0, 1.0, 0.01, 0.0), *singles(*[0.0] * 6)]
    return block("2414", *top, f"{1:10d}{2:10d}{2:10d}{8:10d}{2:10d}{3:10d}", *integers, *reals, *values)


def pole(number: int, value: complex, shape: complex) -> str:
    values = [line for n in (3, 5) for line in (f"{n:10d}", singles(*pairs(shape * n * np.array([0.5, 1.0, 2.0])))[0])]
    counts = [f"{2:10d}{6:10d}{1:10d}{number:10d}", singles(value.real, value.imag, 1.0, 0.0, 1.0, 0.0)[0]]
    kinds = f"{1:10d}{3:10d}{2:10d}{8:10d}{5:10d}{3:10d}"
    return block("55", *["NONE"] * 5, kinds, *counts, *values)


def read(
    tmp_path: Path, text: str | bytes, stated: UnitSystem | None = SI, functions: StatedOfFunctions | None = None
) -> UffContent:
    path = tmp_path / "a.uff"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    with_units = stated if b"   164" not in path.read_bytes() else None
    return read_uff(path, units=SI, file_units=with_units, functions=functions)


def codes(content: UffContent) -> set[str]:
    return {notice.code for notice in content.notices}


def check(content: UffContent, *notices: str) -> None:
    frfs = content.test.frfs
    assert frfs is not None
    assert set(notices) <= codes(content)
    assert frfs.kind == "accelerance"
    np.testing.assert_allclose(frfs.freq_hz, HZ, rtol=1e-5)
    np.testing.assert_allclose(frfs.values[0, 0], ACCELERANCE, rtol=1e-4)


# ----------------------------------------------------------------------------------------------------
# The frame of the file.


def with_tabs(line: str) -> str:
    """As an editor writes it: blanks up to a multiple of eight columns become a tab."""
    parts = [line[i : i + 8] for i in range(0, len(line), 8)]
    return "".join(p.rstrip() + "\t" if len(p) == 8 and p.endswith("  ") else p for p in parts)


@pytest.mark.parametrize(
    ("change", "notices"),
    [
        (lambda text: text.replace("    -1\n", "-1\n"), ["uff.delimiter"]),
        (lambda text: text.replace("    -1\n", "   -1\n"), ["uff.delimiter"]),
        (lambda text: text.replace("    -1\n", "        -1  \n"), ["uff.delimiter"]),
        (lambda text: text.replace("    -1\n", "\t-1\n"), ["uff.delimiter"]),
        (lambda text: text.replace("    -1\n    -1\n", "    -1\n-1\n"), ["uff.delimiter"]),
        (lambda text: text.replace("    -1\n    -1\n", "    -1\nmeasured on 3 May\n\n    -1\n"), ["uff.remark"]),
        (lambda text: "Laboratory 7\n=====\n" + text, ["uff.remark"]),
        (lambda text: text + "end of the measurement\n", ["uff.remark"]),
        (lambda text: text.replace("    -1\n    -1\n", "-1\nremark\n-1\n"), ["uff.remark", "uff.delimiter"]),
        (lambda text: text.replace("    -1\n    -1\n", "    -1\n\n \t\n    -1\n"), []),
        (lambda text: text.replace("    -1\n    58", "    -1\n\n    58"), []),
        (lambda text: text.removesuffix("    -1\n"), ["uff.not-closed"]),
        (lambda text: text.removesuffix("\n    -1\n"), ["uff.not-closed"]),
        (lambda text: text.removesuffix("    -1\n").replace("    -1\n", "-1\n"), ["uff.not-closed"]),
        (lambda text: text + "\x00\x00\x1a", []),
        (lambda text: text.replace("\n", "\r\n"), []),
        (lambda text: text.replace("    -1\n", "-1\n").replace("\n", "\r\n"), ["uff.delimiter"]),
        (lambda text: "\n".join(map(with_tabs, text.split("\n"))), []),
        (lambda text: text.replace("E+00 ", "E+00  ").replace("E-01 ", "E-01   "), ["uff.free-columns"]),
        (lambda text: "\n".join("\t".join(x.split()) if "E" in x and "." in x and i > 30 else x
            for i, x in enumerate(text.split("\n"))), ["uff.free-columns"]),
    ],
)  # fmt: skip
def test_frame(tmp_path: Path, change, notices: list[str]) -> None:  # type: ignore[no-untyped-def]
    if "free-columns" in "".join(notices):
        parts = FILE.split("    -1\n    -1\n    58\n")
        text = parts[0] + "".join("    -1\n    -1\n    58\n" + _body_only(part, change) for part in parts[1:])
    else:
        text = change(FILE)
    content = read(tmp_path, text)
    check(content, *notices)
    assert len(content.functions) == 2
    assert len(content.test.geometry) == 2


def _body_only(part: str, change) -> str:  # type: ignore[no-untyped-def]
    lines = part.split("\n")
    return "\n".join(lines[:11]) + "\n" + change("\n" * 31 + "\n".join(lines[11:])).lstrip("\n")


def test_data_sets_in_any_order(tmp_path: Path) -> None:
    sets = [block("151", *["text"] * 7), NODES, *(mode(i, 5.0 * i) for i in (1, 2)), frf(), UNITS, block("9", "x")]
    for order in (sets, sets[::-1], sets[3:] + sets[:3]):
        content = read(tmp_path, "".join(order), stated=None)
        check(content)
        assert content.test.modes is not None
        assert sorted(content.test.modes.freq_hz) == [5.0, 10.0]


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[: text.rindex("E")],
        lambda text: text[: text.rindex("\n", 0, -10)],
        lambda text: (UNITS + frf() + NODES).removesuffix("    -1\n"),
        lambda text: text.replace("    -1\n    -1\n    58\n", "-1\n    58\n", 1),
        lambda text: text.replace("    -1\n", "-1\n").replace("-1\n-1\n    58\n", "-1\n    58\n", 1),
        lambda text: text.replace("    -1\n    58\n", "", 1),
    ],
)
def test_nothing_is_lost_in_silence(tmp_path: Path, damage) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(FemtuneError) as caught:
        read(tmp_path, damage(FILE))
    assert caught.value.code in ("uff.truncated", "uff.outside", "uff.syntax", "uff.value", "uff.count")


def test_known_by_content(tmp_path: Path) -> None:
    for name, text in {
        "a.dat": FILE, "b.txt": "made by program 7\n" + FILE, "c.ufb": FILE.replace("    -1", "-1"), "d": FILE
    }.items():  # fmt: skip
        (tmp_path / name).write_text(text)
        assert is_universal(tmp_path / name)
    for name, text in {"e.csv": "1,2\n3,4\n", "f.csv": "force\n-1\n2\n", "g.csv": "-1\n15\n", "h": ""}.items():
        (tmp_path / name).write_text(text)
    assert not any(map(is_universal, (tmp_path / "e.csv", tmp_path / "f.csv", tmp_path / "h", tmp_path / "absent")))
    assert names_universal(tmp_path / "absent.bunv")


# ----------------------------------------------------------------------------------------------------
# Binary functions.


def binary(order: str, stated: int, form: int = 2, size: int = 8, values: np.ndarray = ACCELERANCE) -> bytes:
    payload = np.array(pairs(values)).astype(f"{order}f{size}").tobytes()
    lines = "\n".join(head(value_type=6 if size == 8 else 5))
    first = f"    58b{stated:6d}{form:6d}{11:12d}{len(payload):12d}{0:6d}{0:6d}{0:12d}{0:12d}\n"
    return b"    -1\n" + first.encode() + lines.encode() + b"\n" + payload + b"\n    -1\n"


@pytest.mark.parametrize("size", [4, 8])
@pytest.mark.parametrize(("order", "stated"), [("<", 1), (">", 2), ("<", 2), (">", 1), ("<", 0), (">", 0)])
def test_byte_order(tmp_path: Path, order: str, stated: int, size: int) -> None:
    content = read(tmp_path, UNITS.encode() + binary(order, stated, size=size))
    check(content)
    wrong = (order, stated) in (("<", 2), (">", 1), ("<", 0))
    assert ("uff.byte-order" in codes(content)) == wrong


def test_format_of_numbers(tmp_path: Path) -> None:
    check(read(tmp_path, UNITS.encode() + binary("<", 1, form=1)))
    noise = np.random.default_rng(3).bytes(16 * len(HZ))
    odd = binary("<", 1, form=1)
    start = odd.index(b"\n    -1", 50) - 16 * len(HZ)
    with pytest.raises(FemtuneError) as caught:
        read(tmp_path, UNITS.encode() + odd[:start] + noise + odd[start + len(noise) :])
    assert caught.value.code == "uff.value"


def test_zeros_and_small_values_are_no_reason_to_doubt(tmp_path: Path) -> None:
    for values in (np.zeros(len(HZ), dtype=complex), 1e-9 * ACCELERANCE, np.ones(len(HZ)) + 0j):
        content = read(tmp_path, UNITS.encode() + binary("<", 1, values=values))
        assert "uff.byte-order" not in codes(content)
        assert content.test.frfs is not None
        np.testing.assert_array_equal(content.test.frfs.values[0, 0], values)


def test_a_binary_file_without_its_last_delimiter(tmp_path: Path) -> None:
    data = UNITS.encode() + binary("<", 1)
    check(read(tmp_path, data.removesuffix(b"\n    -1\n")), "uff.not-closed")
    with pytest.raises(FemtuneError):
        read(tmp_path, data.removesuffix(b"\n    -1\n")[:-1])


# ----------------------------------------------------------------------------------------------------
# Units and kinds.


@pytest.mark.parametrize(
    ("labels", "factor"),
    [
        (("Hz", "g/N", "N"), 9.80665),
        (("Hz", "g's", "N"), 9.80665),
        (("Hz", "µm/s2", "N"), 1e-6),
        (("Hz", "mil/s2", "lbf"), 2.54e-5 / 4.4482216),
        (("Hz", "gal", "kp"), 0.01 / 9.80665),
        (("Hz", "(m/s²)/N", ""), 1.0),
        (("Hz", "mm/s2", "N"), 1e-3),
        (("Hz", "m/s^2/N", "N"), 1.0),
        (("Hz", "NONE", "kgf"), 1.0 / 9.80665),
    ],
)
@pytest.mark.parametrize("units", [UNITS, ""])
def test_units_of_labels(tmp_path: Path, labels: tuple[str, str, str], factor: float, units: str) -> None:
    content = read(tmp_path, units + frf(ACCELERANCE / factor, labels=labels))
    check(content)
    assert ("uff.unit-label" in codes(content)) == (factor != 1.0)


@pytest.mark.parametrize(
    ("label", "per_hz"), [("rad/s", 2 * np.pi), ("rpm", 60.0), ("kHz", 1e-3), ("Hz", 1.0), ("1/min", 60.0)]
)
def test_units_of_frequency(tmp_path: Path, label: str, per_hz: float) -> None:
    text = frf(start=HZ[0] * per_hz, step=0.5 * per_hz, labels=(label, "m/s2", "N"))
    check(read(tmp_path, UNITS + text), *(["uff.unit-label"] if per_hz != 1.0 else []))


def test_unknown_labels_are_told_with_their_text(tmp_path: Path) -> None:
    content = read(tmp_path, UNITS + frf(labels=("Hz", "EU", "N")))
    check(content, "uff.unit-label")
    assert any("'EU'" in notice.what for notice in content.notices)


def test_labels_in_the_system_of_the_file_change_nothing(tmp_path: Path) -> None:
    millimetres = unit_system("mm-t-s")
    content = read(tmp_path, frf(1e3 * ACCELERANCE, labels=("Hz", "mm/s2", "N")), stated=millimetres)
    check(content)
    assert "uff.unit-label" not in codes(content)


def test_kind_by_label_or_by_the_user(tmp_path: Path) -> None:
    unknown = (18, 0, 0)
    check(read(tmp_path, frf(kinds=unknown, labels=("Hz", "m/s2", "N"))))
    check(read(tmp_path, frf(kinds=(0, 0, 0), labels=("Hz", "m/s2", "N"))))
    nothing = frf(kinds=unknown, labels=("Hz", "NONE", "NONE"))
    assert read(tmp_path, nothing).test.frfs is None
    check(read(tmp_path, nothing, functions=StatedOfFunctions(kind="accelerance")))
    scaled = frf(ACCELERANCE / 9.80665, labels=("Hz", "g", "N"))
    check(read(tmp_path, scaled, functions=StatedOfFunctions(factor=9.80665)))


def test_type_and_label_that_contradict(tmp_path: Path) -> None:
    """The driving point decides; without one nothing is assumed."""
    label = ("Hz", "m/s", "N")
    check(read(tmp_path, frf(labels=label)), "uff.kind-contradicts")
    mobility = read(tmp_path, frf(ACCELERANCE / (1j * OMEGA), labels=label)).test.frfs
    assert mobility is not None
    assert mobility.kind == "mobility"
    with pytest.raises(FemtuneError) as caught:
        read(tmp_path, frf(labels=label, response=5))
    assert caught.value.code == "uff.kind-contradicts"
    stated = read(tmp_path, frf(labels=label, response=5), functions=StatedOfFunctions("accelerance"))
    check(stated)


def test_no_value_at_zero_hz(tmp_path: Path) -> None:
    text = frf(start=0.0, step=0.5).replace(singles(ACCELERANCE[0].real)[0], "          NaN", 1)
    content = read(tmp_path, UNITS + text)
    frfs = content.test.frfs
    assert frfs is not None
    assert (len(frfs.freq_hz), frfs.freq_hz[0]) == (len(HZ) - 1, 0.5)
    np.testing.assert_allclose(frfs.values[0, 0], ACCELERANCE[1:], rtol=1e-4)
    assert "uff.undefined-at-zero" in codes(content)
    with pytest.raises(FemtuneError):
        read(tmp_path, UNITS + frf().replace(singles(ACCELERANCE[0].real)[0], "          NaN", 1))


# ----------------------------------------------------------------------------------------------------
# Modes.


def test_modes_of_data_set_2414(tmp_path: Path) -> None:
    one, other = (
        read(tmp_path, "".join(mode(i, 4.0 * i, data_set=number) for i in (1, 2))).test.modes
        for number in ("55", "2414")
    )
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(one.shapes, other.shapes)
    assert one.freq_hz.tolist() == other.freq_hz.tolist() == [4.0, 8.0]
    assert other.damping_ratio is not None
    assert (other.damping_ratio.tolist(), other.normalisation, other.labels) == ([0.01, 0.01], "mass", ("1", "2"))
    assert other.dofs == one.dofs


@pytest.mark.parametrize("number", [0, 1, 7])
def test_modes_that_are_not_numbered(tmp_path: Path, number: int) -> None:
    text = "".join(mode(number, f, note=f"mode at {f} Hz") for f in (4.0, 6.0, 5.0))
    content = read(tmp_path, text)
    assert content.test.modes is not None
    assert content.test.modes.labels == ("1", "2", "3")
    assert content.test.modes.freq_hz.tolist() == [4.0, 6.0, 5.0]
    assert "uff.mode-numbers" in codes(content)


def test_modes_of_two_configurations_stay_an_error(tmp_path: Path) -> None:
    for text in (mode(1, 4.0, note="BC") + mode(1, 5.0, note="DC"), mode(1, 4.0) + mode(1, 4.0)):
        with pytest.raises(FemtuneError) as caught:
            read(tmp_path, text)
        assert caught.value.code == "uff.repeated-mode"


def test_conjugate_pairs(tmp_path: Path) -> None:
    first, second = -0.5 + 20j, -1.0 + 45j
    shape = 1.0 + 0.2j
    lone = pole(1, first, shape) + pole(2, second, shape)
    both = pole(1, first, shape) + pole(2, first.conjugate(), shape.conjugate()) + pole(3, second, shape)
    below = pole(1, first.conjugate(), shape.conjugate()) + pole(2, second, shape)
    real = lone + pole(3, -30.0 + 0j, 1.0)
    wanted = read(tmp_path, lone).test.modes
    assert wanted is not None
    for text in (both, below, real):
        content = read(tmp_path, text)
        assert content.test.modes is not None
        np.testing.assert_allclose(content.test.modes.freq_hz, wanted.freq_hz)
        np.testing.assert_allclose(content.test.modes.shapes, wanted.shapes)
        np.testing.assert_allclose(content.test.modes.damping_ratio, wanted.damping_ratio)
        assert "uff.pole" in codes(content)


def test_a_node_that_lacks_one_mode(tmp_path: Path) -> None:
    content = read(tmp_path, mode(1, 4.0) + mode(2, 6.0, nodes=(7, 3)) + mode(3, 8.0))
    modes = content.test.modes
    assert modes is not None
    assert sorted({dof.node for dof in modes.dofs}) == [3, 7]
    assert "uff.modes-differ" in codes(content)
    assert any(" 5 (" in notice.what and notice.what.endswith("2)") for notice in content.notices)


def test_the_last_mode_without_its_delimiter(tmp_path: Path) -> None:
    text = mode(1, 4.0) + mode(2, 6.0)
    content = read(tmp_path, text.removesuffix("    -1\n"))
    assert content.test.modes is not None
    assert len(content.test.modes) == 2
    with pytest.raises(FemtuneError):
        read(tmp_path, "\n".join(text.removesuffix("    -1\n").splitlines()[:-2]) + "\n")


def test_shifted_delimiters_are_lines_of_data_where_nothing_begins(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    path.write_text(block("9999", f"{-1:10d}", "text", f"{-1:10d}", "more") + NODES)
    assert [(one.number, len(one.lines)) for one in scan_uff(path)] == [(9999, 4), (15, 2)]
