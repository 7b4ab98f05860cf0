//! Differentiable distortions of pictures, for training marks that stand them.
