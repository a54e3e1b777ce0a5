"""How a picture shows a code: what its grey levels mean, the pens, tiles, strokes, dots and tone curves that drew it,
and how a rendering is compared with it."""
