"""How a picture shows a code: the meaning of its grey levels, and the pens, tiles, strokes and tone curves."""
