"""Growth, for shapes without a code: as many small copies as asked for, moved together until they cover the shape."""
