"""Which parameters the data can determine."""

from femtune.select.identifiability import Combination, Identifiability, identifiability
from femtune.select.words import combination_text, sentences, verdict

__all__ = ["Combination", "Identifiability", "combination_text", "identifiability", "sentences", "verdict"]
