"""The search on the measure that an image shows: stages 1 and 2."""
