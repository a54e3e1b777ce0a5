"""Simpler codes that draw the same: doubles, contained and needless maps, parents, simple numbers, symmetry."""
