"""Which parameters the data can determine."""

from femtune.select.identifiability import NO_EFFECT, Combination, Identifiability, determined, identifiability
from femtune.select.words import combination_text, sentences, verdict

__all__ = [
    "NO_EFFECT",
    "Combination",
    "Identifiability",
    "combination_text",
    "determined",
    "identifiability",
    "sentences",
    "verdict",
]
