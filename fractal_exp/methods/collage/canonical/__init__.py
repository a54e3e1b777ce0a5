"""The last digits of a code: simple numbers, symmetry, the exact frame."""
