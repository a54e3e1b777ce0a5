"""Collage search finds the maps of a code from the measure that an image shows. See docs/method.md.

`params` holds every parameter. `pipeline` runs the search from start to end over the resumable `state`. `measure`
covers the image's measure with copies of itself (stages 1 and 2), `image` compares renderings with the image (stage 3).
`stages` is the plan of a search, and `simplify` finds simple numbers and fewer maps.
"""
