"""Amortised set prediction: a network that reads a set of maps off an image, in no order."""
