"""Trees and plants drawn as strokes: a trunk, and the registration of strokes with the lines of a picture."""
