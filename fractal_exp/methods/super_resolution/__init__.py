"""Super-resolution: a transformer that draws the image eight times as large. It finds no code."""
