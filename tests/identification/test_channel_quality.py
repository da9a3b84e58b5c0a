"""Quality of channels: noise from neighbouring lines against the noise that was added, and ranks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.dofs import DofSet
from femtune.identification import InputKnown
from femtune.identification.channel_quality import quality, relative_noise
from femtune.modal import FrfSet

LINES = np.linspace(10.0, 60.0, 4000)
NOISE = np.array([0.002, 0.03, 0.01, 0.005])


@pytest.fixture(scope="module")
def frfs() -> FrfSet:
    """A mass and a resonance, with a relative noise of its own for each output."""
    rng = np.random.default_rng(2)
    smooth = 1.0 + LINES**2 / (35.0**2 - LINES**2 + 2j * 0.01 * 35.0 * LINES)
    chance = rng.standard_normal((2, 4, 2, len(LINES)))
    values = smooth * (1.0 + NOISE[:, None, None] * (chance[0] + 1j * chance[1]))
    outputs, inputs = DofSet.parse(["1Z+", "2Z+", "3Z+", "4Z+"]), DofSet.parse(["1Z+", "2Z+"])
    return FrfSet(LINES, values, outputs, inputs, "accelerance")


def test_noise_is_that_which_was_added(frfs: FrfSet) -> None:
    # 8000 differences: the median is known to 2 %, 4 σ
    np.testing.assert_allclose(relative_noise(frfs.values), NOISE, rtol=0.08)


def test_ranks_by_noise_and_by_coherence(frfs: FrfSet) -> None:
    assert quality(frfs).order == [1, 2, 3, 0]
    coherence = np.broadcast_to(np.array([0.9, 0.99, 0.7, np.nan])[:, None, None], frfs.values.shape)
    known = replace(frfs, coherence=coherence)
    assert quality(known).order == [2, 0, 1]
    assert quality(known).words == "the lowest coherence"
    assert quality(known, "noise").order == [1, 2, 3, 0]
    assert quality(frfs, "coherence").order == []


def test_outputs_that_were_not_measured_have_no_rank(frfs: FrfSet) -> None:
    values = frfs.values.copy()
    values[1] = np.nan
    assert quality(replace(frfs, values=values)).order == [2, 3, 0]


def test_of_one_output_and_many_inputs_the_inputs_are_ranked(frfs: FrfSet) -> None:
    """As with a moved hammer; what the outputs of the fixture are, its transpose has as inputs."""
    moved = FrfSet(LINES, frfs.values.swapaxes(0, 1)[:1], DofSet([frfs.references[0]]), frfs.responses, frfs.kind)
    found = quality(moved)
    assert found.of_inputs
    assert found.order == [1, 2, 3, 0]
    assert not quality(frfs).of_inputs


@pytest.mark.slow
def test_ranks_by_the_error_of_an_identified_system(frfs: FrfSet) -> None:
    """A further resonance that one output alone has, and that is no mode of the others, is no noise between lines."""
    lines = LINES[::10]
    values = frfs.values[:, :, ::10].copy()
    values[3] += 20.0 * np.sin(40.0 * lines) / lines
    thin = replace(frfs, freq_hz=lines, values=values)
    found = quality(thin, "fit", InputKnown(largest_order=12))
    assert found.order[0] == 3
    assert found.words == "the largest error of the identified system"
    assert found.values[1] == pytest.approx(NOISE[1] * np.sqrt(2.0), rel=0.3)
    # of a hammer that roves over the same points the inputs are ranked, and the errors are the same
    one = replace(thin, values=values[:, :1], references=thin.references.select([0]))
    plain, roving = (quality(some, "fit", InputKnown(largest_order=12)) for some in (one, one.transposed()))
    assert roving.of_inputs
    assert roving.order == plain.order
    np.testing.assert_allclose(roving.values, plain.values, rtol=1e-6)
