"""Collage search: the maps of a code, found from the measure that a picture shows. See docs/collage.md."""
