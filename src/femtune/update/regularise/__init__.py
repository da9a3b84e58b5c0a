"""Side constraints: what is wanted of the parameters besides agreement with the test."""

from femtune.update.regularise.change import MinimumChange
from femtune.update.regularise.choice import RegularisationPath, Weight, WeightChoice, WeightStatus
from femtune.update.regularise.distance import Distance
from femtune.update.regularise.identical import Identical
from femtune.update.regularise.link import Link, link_weights
from femtune.update.regularise.none import NoRegularisation
from femtune.update.regularise.path import regularisation_path
from femtune.update.regularise.prior import Prior, correlated_prior
from femtune.update.regularise.side import LinearModel, Regularisation, SideConstraint
from femtune.update.regularise.together import Together
from femtune.update.regularise.truncated import Truncated
from femtune.update.regularise.weight import choose_weight, reweighed

__all__ = [
    "Distance",
    "Identical",
    "LinearModel",
    "Link",
    "MinimumChange",
    "NoRegularisation",
    "Prior",
    "Regularisation",
    "RegularisationPath",
    "SideConstraint",
    "Together",
    "Truncated",
    "Weight",
    "WeightChoice",
    "WeightStatus",
    "choose_weight",
    "correlated_prior",
    "link_weights",
    "regularisation_path",
    "reweighed",
]
