"""Messages of values that no structure or test has: each is the example that its page shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import DofSet
from femtune.errors import Notice
from femtune.modal import ModeSet
from femtune.steps.check.run import check_study
from femtune.study.study import load_study
from femtune.testdata.checks import check_modes
from femtune.testing import example_deck, example_test

HEAD = '[study]\ntitle = "x"\ndeck = "{}"\nunits = "m-kg-s"\n[test]\nfile = "{}"\n'
TABLES = {
    "parameter.meaningless-bound": '[[parameter]]\nname = "E"\nfields = ["MAT1 1 E"]\nlower = -20\nupper = 20\n',
    "study.large-length": "[sensors]\nposition_sd = 2.0\n",
    "study.large-angle": "[sensors]\nangle_sd_deg = 180.0\n",
    "study.damping-doubtful": "[response]\nratio = 0.5\n",
}
HEAVY = '[[configuration]]\nname = "bench"\ntest = "{}"\nmasses = [{{ node = 2, mass = 2000.0 }}]\n'

pytestmark = pytest.mark.usefixtures("empty_folder")


def notices(text: str) -> tuple[Notice, ...]:
    Path("study.toml").write_text(text)
    return check_study(Path("study.toml")).remarks


def _check(found: tuple[Notice, ...], code: str) -> None:
    (notice,) = [n for n in found if n.code == code]
    check_shown(code, notice)


@pytest.mark.parametrize("code", TABLES)
def test_page_shows_the_notice_of_a_table(code: str) -> None:
    _check(notices(HEAD.format(example_deck().name, example_test().name) + TABLES[code]), code)


def test_page_shows_heavy_masses() -> None:
    head, _, _ = HEAD.format(example_deck().name, "").partition("[test]")
    _check(notices(head + HEAVY.format(example_test().name)), "study.heavy-masses")


def test_page_shows_damping_in_percent() -> None:
    modes = ModeSet(np.array([3.0, 7.0]), np.eye(2), DofSet.parse(["1Z+", "2Z+"]), damping_ratio=np.array([0.8, 1.5]))
    _check(check_modes(modes), "test.damping-doubtful")


def test_page_shows_a_weight_density() -> None:
    deck = example_deck()
    deck.write_text(deck.read_text().replace("7850.", "76982."))
    _check(load_study(deck).notices, "deck.weight-density")
