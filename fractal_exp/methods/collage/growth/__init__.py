"""Growth, for pictures without a code: as many small copies as asked for, moved together until they show it."""
