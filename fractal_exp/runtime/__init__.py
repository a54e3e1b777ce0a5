"""What a computation stands on: threads, seeds, precision, compilation, checkpoints, files, checks of input."""
