"""Collage search: the maps of a code, found from the measure that an image shows. See docs/collage.md.

`params` holds every parameter. `pipeline` is the search from top to bottom, over the resumable `state`. `measure`
covers the image's measure with copies of itself (stages 1 and 2), `image` compares renderings with the image (stage 3),
and `canonical` finds the last digits.
"""
