"""The stages of collage search, and what they share."""
