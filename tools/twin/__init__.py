"""The steps of an embedding in PyTorch: what the engine is compared with, in figures and in time."""
