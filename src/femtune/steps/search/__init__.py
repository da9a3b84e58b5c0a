"""The minimum of the residuals in the whole box."""
