"""Facts and checks of the model."""
