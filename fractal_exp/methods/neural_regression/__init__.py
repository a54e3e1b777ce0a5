"""Neural regression: a convolutional network that reads the numbers of a code off its image."""
