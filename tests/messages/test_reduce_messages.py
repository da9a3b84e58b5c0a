"""Messages of reduced models, word for word."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.files.reduced_basis import load_basis
from femtune.model.reduce import Component, couple, guyan, serep

K = np.diag([2.0, 2.0, 1.0]) - np.eye(3, k=1) - np.eye(3, k=-1)
M = np.eye(3)


def _text(error: pytest.ExceptionInfo[FemtuneError]) -> str:
    return str(error.value)


def test_masters() -> None:
    with pytest.raises(FemtuneError) as error:
        guyan(K, M, [0, 3])
    assert _text(error) == (
        "[reduce.masters] the masters are not a set of degrees of freedom of the model\n"
        "  masters = 2\n  degrees of freedom = 3\n\nhint: give each free DOF that is kept once, by its position"
    )


def test_loose_slaves() -> None:
    loose = K - np.diag([1.0, 0.0, 0.0])
    with pytest.raises(FemtuneError) as error:
        guyan(np.kron(np.eye(2), loose), np.eye(6), [0])
    assert _text(error) == (
        "[reduce.slaves-loose] the slaves can move without stiffness while the masters are held\n\n"
        "hint: keep masters that hold every part; at a frequency, take another one"
    )


def test_modes_that_masters_do_not_tell_apart() -> None:
    with pytest.raises(FemtuneError) as error:
        serep(K, M, [0], np.eye(3)[:, :2])
    assert _text(error) == (
        "[reduce.modes-unseen] 2 modes cannot be told apart at 1 masters\n\n"
        "hint: keep fewer modes or more masters, where the modes move differently"
    )


def test_interface_names() -> None:
    with pytest.raises(FemtuneError) as error:
        couple([Component(guyan(K, M, [0, 2]), ["a", "a"])])
    assert _text(error) == (
        "[reduce.interface] 2 names are given for 2 interface DOFs of a component\n\n"
        "hint: name each interface DOF once, in the order of the component's masters"
    )


def test_damaged_basis(tmp_path: Path) -> None:
    path = tmp_path / "basis.npz"
    path.write_bytes(b"PK no archive")
    with pytest.raises(FemtuneError) as error:
        load_basis(path, None)  # type: ignore[arg-type]
    assert _text(error) == (
        f"[reduce.damaged] the basis cannot be used: File is not a zip file\n  at {path}\n\n"
        "hint: remove the file and train the reduced model again"
    )
