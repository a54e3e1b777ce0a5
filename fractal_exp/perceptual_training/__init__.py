"""How the network of the perceptual distance `fractal` is trained: pictures of fractals and of codes near by, drawn on
the fly (`pictures`, `perturbations`, `paths`), the loop (`training`), and what it is judged by (`held_out`).
"""
