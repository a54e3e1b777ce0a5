"""The search that compares renderings with the image: stage 3."""
