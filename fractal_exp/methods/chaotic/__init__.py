"""The paper's method: a differentiable chaos game, splatted and fitted by a hybrid optimiser."""
