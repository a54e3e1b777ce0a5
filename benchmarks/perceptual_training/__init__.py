"""How the network of the perceptual distance `fractal` was trained: pictures of fractals and of codes near by, drawn on
the fly (`pictures`, `perturbations`, `paths`), its task for the training loop of the package (`training`), and what it
is judged by (`held_out`, `scores`). `python -m benchmarks.perceptual_training` trains it.
"""
