"""Methods of identification and estimators, by their words in identification files and studies."""

from __future__ import annotations

from typing import Literal, get_args

from femtune.kinds import Kind, Kinds

KnownInputMethod = Literal["N4SID", "pLSCF"]
KNOWN_INPUT: tuple[KnownInputMethod, ...] = get_args(KnownInputMethod)
"""Methods that identify modes from FRFs."""

OutputOnlyMethod = Literal["SSI-cov", "SSI-data", "ERA", "FDD", "TFIE", "TFIE-magnitude"]
OUTPUT_ONLY = Kinds(
    OutputOnlyMethod,
    Kind("SSI-cov", function="femtune.identification.operational:by_covariances"),
    Kind("SSI-data", function="femtune.identification.operational:by_data"),
    Kind("ERA", function="femtune.identification.operational:by_era"),
    Kind("FDD", function="femtune.identification.operational:by_decomposition"),
    Kind("TFIE", function="femtune.identification.operational:by_steady_phases"),
    Kind("TFIE-magnitude", function="femtune.identification.operational:by_steady_magnitudes"),
)
"""Methods that identify modes from responses to unmeasured forces."""

OF_SPECTRA = ("SSI-cov", "ERA", "FDD")
"""Methods for auto and cross spectra of responses."""

SpectraWindow = Literal["hann", "hamming", "flattop", "boxcar", "none"]
"""Window of the segments that were averaged to spectra; "none" for spectra of correlation functions."""

MethodWord = Literal[KnownInputMethod, OutputOnlyMethod]
"""Any method of identification."""

FrfEstimator = Literal["H1", "H2", "Hv"]
FRF_ESTIMATORS = Kinds(
    FrfEstimator,
    Kind("H1", function="femtune.identification.estimators:h1"),
    Kind("H2", function="femtune.identification.estimators:h2"),
    Kind("Hv", function="femtune.identification.estimators:hv"),
)
"""Estimators of FRFs from averaged spectra."""

GapWay = Literal["parts", "longest"]
"""What is done with a record in which samples are missing: its parts between the gaps are records of their own, or only
the longest one is used."""

ChannelRule = Literal["coherence", "noise", "fit"]
"""Channels of measured FRFs are judged by their mean coherence, by their relative noise, or by how well an identified
system fits them."""

Drawing = Literal["lines", "entries", "noise"]
DRAWINGS = Kinds(
    Drawing,
    Kind("lines", "frequency lines drawn with replacement"),
    Kind("entries", "single FRF values drawn with replacement"),
    Kind("noise", "noise of the stated standard deviations"),
)
"""What a bootstrap draws again: frequency lines, all functions of a line together; single values of the functions; or
noise of the stated standard deviations about the FRFs of the updated model."""
