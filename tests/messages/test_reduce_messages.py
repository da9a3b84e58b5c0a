"""Messages of reduced models, word for word."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

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
    check_shown("reduce.masters", _text(error))


def test_loose_slaves() -> None:
    loose = K - np.diag([1.0, 0.0, 0.0])
    with pytest.raises(FemtuneError) as error:
        guyan(np.kron(np.eye(2), loose), np.eye(6), [0])
    check_shown("reduce.slaves-loose", _text(error))


def test_modes_that_masters_do_not_tell_apart() -> None:
    with pytest.raises(FemtuneError) as error:
        serep(K, M, [0], np.eye(3)[:, :2])
    check_shown("reduce.modes-unseen", _text(error))


def test_interface_names() -> None:
    with pytest.raises(FemtuneError) as error:
        couple([Component(guyan(K, M, [0, 2]), ["a", "a"])])
    check_shown("reduce.interface", _text(error))


def test_damaged_basis(tmp_path: Path) -> None:
    path = tmp_path / "basis.npz"
    path.write_bytes(b"PK no archive")
    with pytest.raises(FemtuneError) as error:
        load_basis(path, None)  # type: ignore[arg-type]
    check_shown("reduce.damaged", _text(error).replace(f"{path.parent}/", ""))
