"""Shapes of no code: as many small copies as asked for, moved all together until they cover the shape."""
