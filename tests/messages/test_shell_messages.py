"""Messages of shells: each is the example that its page shows."""

from __future__ import annotations

import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.fem.elements import contributions
from structures.shells import Isotropic, Section, ShellPart, shell_structure

_SQUARE = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
_REFLEX = [[0.0, 0, 0], [1, 0, 0], [0.2, 0.2, 0], [0, 1, 0]]
_CASES = {
    "element.shell-shape": (_REFLEX, 0.1, (0.0, 0.0, 0.0)),
    "element.shell-thickness": (_SQUARE, 0.0, (0.0, 0.0, 0.0)),
    "element.material-direction": (_SQUARE, 0.1, (0.0, 0.0, 1.0)),
}


@pytest.mark.parametrize("code", _CASES)
def test_the_page_shows_the_message(code: str):
    last, t, direction = _CASES[code]
    sound = ShellPart([[0, 1, 2, 3]] * 11, Section(Isotropic(200.0, 0.3), 0.1))
    faulty = ShellPart([[4, 5, 6, 7]], Section(Isotropic(200.0, 0.3), t), direction=direction)
    structure = shell_structure([*_SQUARE, *last], [sound, faulty])
    with pytest.raises(FemtuneError) as caught:
        contributions(structure.batches[1], structure)
    assert caught.value.code == code
    check_shown(code, caught.value)
