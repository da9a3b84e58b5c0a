"""[[level]] of an identification: is the structure linear over several levels of force?"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from tests.messages.shown import check_shown

from femtune import identify
from femtune.cli import main
from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.files.uff import write_uff_frfs
from femtune.identification.linearity import ForceLevel, LinearityLimits, check_linearity
from femtune.modal import FrfSet, ModeSet
from femtune.testdata import ModalTest
from femtune.units import SI
from structures.laboratory import (
    Clock,
    MeasuringChain,
    accelerance,
    plant_of_matrices,
    simulated_test,
    white_noise,
)

DOFS = DofSet(Dof(i, "X") for i in (1, 2, 3))
STIFFNESS = 900.0 * (2.0 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1))
LINES = np.linspace(0.5, 12.0, 400)


def _frfs(factor: float = 1.0, damping: float = 0.01, noise: float = 0.0, seed: int = 0) -> FrfSet:
    """FRFs of three masses whose frequencies are `factor` times those of the first level."""
    plant = plant_of_matrices(
        np.eye(3), factor**2 * STIFFNESS, damping, np.eye(3), DOFS, np.eye(3)[:1], DOFS.select([0])
    )
    frfs = accelerance(plant, LINES)
    rng = np.random.default_rng(seed)
    error = rng.standard_normal((2, *frfs.values.shape)) * noise / np.sqrt(2.0)
    return replace(frfs, values=frfs.values + error[0] + 1j * error[1])


def _modes(factor: float = 1.0, damping: float = 0.01, sd: float | None = None) -> ModeSet:
    values, shapes = np.linalg.eigh(STIFFNESS)
    hz = factor * np.sqrt(values) / (2.0 * np.pi)
    spread = None if sd is None else np.full(3, sd)
    return ModeSet(hz, shapes, DOFS, damping_ratio=np.full(3, damping), freq_sd_hz=spread)


def test_a_power_law_gives_its_exponent() -> None:
    """Frequencies ∝ force^-0.01: −0.69 % for twice the force; the line over log2 of the force is its tangent."""
    levels = [ForceLevel(str(f), f, _modes(f**-0.01, 0.01 * f**0.1)) for f in (1.0, 2.0, 4.0)]
    found = check_linearity(levels)
    assert found.linear is False
    assert not any(m.linear for m in found.modes)
    for mode in found.modes:
        assert mode.frequency.largest == pytest.approx(4.0**-0.01 - 1.0)
        assert mode.frequency.per_doubling == pytest.approx(0.5 * (4.0**-0.01 - 1.0), rel=1e-6)
        assert mode.damping.largest == pytest.approx(4.0**0.1 - 1.0)
        # 15 % more damping is within the limit of 20 %
        assert not mode.damping.beyond


def test_a_change_within_its_noise_is_no_evidence() -> None:
    sd = 0.02
    quiet = [ForceLevel("a", 1.0, _modes(1.0, sd=sd)), ForceLevel("b", 2.0, _modes(1.01, sd=sd))]
    found = check_linearity(quiet)
    change = 0.01 * _modes().freq_hz
    wanted = [bool(c <= 3.0 * np.hypot(sd, sd * 1.01)) for c in change]
    assert [m.linear for m in found.modes] == wanted
    assert wanted[0]
    assert not wanted[2]
    trend = found.modes[2].frequency
    hz = _modes().freq_hz[2]
    assert trend.largest_sd == pytest.approx(np.hypot(sd, 1.01 * sd) / hz)
    assert trend.per_doubling == pytest.approx(0.01)
    assert trend.per_doubling_sd == pytest.approx(np.hypot(sd, sd) / hz)


def test_functions_of_a_linear_structure_differ_by_their_noise() -> None:
    noise = 0.002
    sd = np.full((3, 1, 400), noise)
    levels = [
        ForceLevel("a", 1.0, _modes(), _frfs(noise=noise), sd),
        ForceLevel("b", 5.0, _modes(), _frfs(noise=noise, seed=1), sd),
    ]
    found = check_linearity(levels)
    assert found.linear is True
    (of_level,) = found.functions
    assert of_level.functions == 3
    assert of_level.lines == 400
    assert of_level.change == pytest.approx(of_level.noise, rel=0.05)
    softer = replace(levels[1], frfs=_frfs(0.99, noise=noise, seed=1), modes=_modes(0.99))
    found = check_linearity([levels[0], softer])
    assert found.linear is False
    assert found.functions[0].differing == 3
    assert found.functions[0].change > 10.0 * found.functions[0].noise


def test_strong_noise_that_is_known_is_not_called_nonlinear_and_unknown_noise_is() -> None:
    noise = 2.0
    sd = np.full((3, 1, 400), noise)
    one, other = _frfs(noise=noise), _frfs(noise=noise, seed=1)
    known = check_linearity([ForceLevel("a", 1.0, _modes(), one, sd), ForceLevel("b", 2.0, _modes(), other, sd)])
    assert known.functions[0].frac < 0.9
    assert known.linear is True
    unknown = check_linearity([ForceLevel("a", 1.0, _modes(), one), ForceLevel("b", 2.0, _modes(), other)])
    assert unknown.linear is False


def test_signs_order_and_lines_may_differ() -> None:
    first, other = _frfs(), _frfs()
    turned = FrfSet(
        other.freq_hz[50:300], -other.values[::-1, :, 50:300],
        DofSet(Dof(i, "X", -1) for i in (3, 2, 1)), other.references, other.kind,
    )  # fmt: skip
    found = check_linearity([ForceLevel("a", 1.0, _modes(), first), ForceLevel("b", 1.0, _modes(), turned)])
    assert found.functions[0].lines == 250
    assert found.functions[0].frac == pytest.approx(1.0)
    assert found.functions[0].change == pytest.approx(0.0, abs=1e-12)
    # equal levels have no slope
    assert np.isnan(found.modes[0].frequency.per_doubling)
    assert found.linear is True


def test_what_cannot_be_compared_is_not_tested() -> None:
    none = ModeSet(np.zeros(0), np.zeros((3, 0)), DOFS)
    found = check_linearity([ForceLevel("a", 1.0, _modes()), ForceLevel("b", 2.0, none)], LinearityLimits())
    assert found.linear is None
    assert [m.linear for m in found.modes] == [None] * 3
    assert found.functions[0].reason == "no functions were measured"
    shifted = replace(_frfs(), freq_hz=LINES + 0.013)
    apart = check_linearity([ForceLevel("a", 1.0, none, _frfs()), ForceLevel("b", 2.0, none, shifted)])
    assert "frequency lines" in apart.functions[0].reason


def _files(folder: Path, factors: tuple[float, ...], tail: str = "", **more: float) -> Path:
    for k, factor in enumerate(factors):
        frfs = _frfs(factor, seed=k, **more)
        write_uff_frfs(folder / f"level{k + 1}.unv", ModalTest("t", SI, frfs=frfs))
    levels = "".join(
        f'[[level]]\nfrfs = "level{k + 1}.unv"\nforce = {4.0**k}\nname = "{4.0**k:g} N"\n'
        for k in range(1, len(factors))
    )
    path = folder / "identify.toml"
    text = '[identify]\nfrfs = "level1.unv"\nlargest_order = 12\nmethods = ["pLSCF"]\n'
    path.write_text(f"{text}{levels}[linearity]\nforce = 1.0\n{tail}", encoding="utf-8")
    return path


@pytest.mark.slow
def test_levels_of_a_softening_structure_are_reported(tmp_path: Path) -> None:
    made = identify(_files(tmp_path, (1.0, 0.98), noise=1e-4))
    found = made.record.linearity
    assert found is not None
    assert found.names == ("level1.unv (1)", "4 N")
    assert found.linear is False
    assert [m.frequency.largest_percent for m in found.modes] == pytest.approx([-2.0] * 3, abs=0.02)
    # two doublings
    assert [m.frequency.per_doubling_percent for m in found.modes] == pytest.approx([-1.0] * 3, abs=0.02)
    assert found.functions[0].frac is not None
    assert found.functions[0].frac < 0.9
    (alert,) = [a for a in made.record.alerts if a.code == "frf.not-linear"]
    assert alert.sentence.startswith("the structure is not linear: largest change of a frequency -2.00 % ± ")
    assert made.linearity.column("linear").tolist() == [False] * 3
    data = json.loads((made.folder / "identified.json").read_text(encoding="utf-8"))
    assert data["linearity"]["linear"] is False
    page = (made.folder / "report.html").read_text(encoding="utf-8")
    assert "FRFs at several levels of force" in page
    assert "not linear" in page


@pytest.mark.slow
def test_levels_of_a_linear_structure_are_called_linear(tmp_path: Path) -> None:
    path = _files(tmp_path, (1.0, 1.0), noise=1e-3)
    shown = CliRunner().invoke(main, ["identify", str(path)])
    assert shown.exit_code == 0, shown.output
    assert "linear within the limits" in " ".join(shown.output.split())
    assert "frf.not-linear" not in shown.output


@pytest.mark.slow
def test_the_noise_of_functions_without_deviations_is_estimated(tmp_path: Path) -> None:
    """Noise of known size, from the fit and from neighbouring lines; the change between the levels agrees with it."""
    found = identify(_files(tmp_path, (1.0, 1.0), noise=0.5)).record.linearity
    assert found is not None
    (functions,) = found.functions
    size = np.linalg.norm(_frfs().values)
    wanted = 100.0 * 0.5 * np.sqrt(2.0 * _frfs().values.size) / size
    assert functions.noise_percent == pytest.approx(wanted, rel=0.15)
    assert functions.change_percent == pytest.approx(wanted, rel=0.05)
    assert found.linear is True


@pytest.mark.parametrize(
    ("text", "code", "name"),
    [
        ('[[level]]\nrecord = "level1.unv"\nforce = 2.0\n[linearity]\nforce = 1.0\n', "identify.level", "other kind"),
        ("[[level]]\nforce = 2.0\n[linearity]\nforce = 1.0\n", "identify.level", ""),
        ('[[level]]\nfrfs = "level1.unv"\nforce = 2.0\n', "identify.level", "first force"),
        ("[linearity]\nforce = 1.0\n", "identify.level", "none"),
        ('[[level]]\nfrfs = "level1.unv"\nforce = 0.0\n[linearity]\nforce = 1.0\n', "study.value", ""),
        (
            '[[level]]\nfrfs = "level1.unv"\nforce = 2.0\n[linearity]\nforce = 1.0\nleast_frac = 1.5\n',
            "study.value",
            "",
        ),
    ],
)
def test_bad_levels_are_errors(tmp_path: Path, text: str, code: str, name: str) -> None:
    path = _files(tmp_path, (1.0,))
    whole = path.read_text(encoding="utf-8")
    path.write_text(whole[: whole.index("[linearity]")] + text, encoding="utf-8")
    with pytest.raises(FemtuneError) as error:
        identify(path)
    assert error.value.code == code
    assert error.value.where is not None
    if name:
        check_shown(f"{code}, {name}", str(error.value).replace(f"{tmp_path}/", ""))


def test_a_level_without_a_file_is_named(tmp_path: Path) -> None:
    path = _files(tmp_path, (1.0, 1.0))
    (tmp_path / "level2.unv").unlink()
    with pytest.raises(FemtuneError) as error:
        identify(path)
    assert "level2.unv" in str(error.value)


@pytest.mark.slow
def test_records_of_two_levels_are_compared_beside_their_own_noise(tmp_path: Path) -> None:
    """White noise of two levels on a linear structure: the change of the functions is that of their noise."""
    clock = Clock(400.0, 50.0, 5.0)
    for k, force in enumerate((1.0, 4.0)):
        signal = force * white_noise(np.random.default_rng(k), 1, clock.fine_samples)[0]
        inputs = np.vstack([signal, np.zeros((2, len(signal)))])
        plant = plant_of_matrices(np.eye(3), STIFFNESS, 0.01, np.eye(3), DOFS, np.eye(3), DOFS)
        made = simulated_test(plant, inputs, clock, MeasuringChain(30.0), k, measured_inputs=(0,))
        np.save(tmp_path / f"level{k + 1}.npy", made.values)
    channels = "".join(f'[[channel]]\ncolumn = {i}\ndof = "{i}X+"\n' for i in (1, 2, 3))
    force = '[[channel]]\ncolumn = 4\ndof = "1X+"\nquantity = "force"\nrole = "input"\n'
    text = (
        '[identify]\nrecord = "level1.npy"\nsampling_hz = 50.0\nband_hz = [1.0, 12.0]\nlargest_order = 16\n'
        '[linearity]\nforce = 1.0\n[[level]]\nrecord = "level2.npy"\nforce = 4.0\n'
    )
    path = tmp_path / "identify.toml"
    path.write_text(text + channels + force, encoding="utf-8")
    found = identify(path).record.linearity
    assert found is not None
    assert found.linear is True
    (functions,) = found.functions
    assert functions.noise_percent is not None
    assert functions.change_percent is not None
    assert functions.change_percent == pytest.approx(functions.noise_percent, rel=0.4)
    assert all(m.frequency.sd_percent is not None for m in found.modes)
