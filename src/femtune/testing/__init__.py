"""Public checks for those who write elements, models and readers."""

from femtune.testing.contributions import check_contribution

__all__ = ["check_contribution"]
