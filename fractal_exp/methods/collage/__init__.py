"""Collage search finds the maps of a code from the measure that an image shows. See docs/method.md.

`params` holds every parameter. `pipeline` runs the search from start to end over the resumable `state`. `measure`
covers the image's measure with copies of itself (stages 1 and 2), `image` compares renderings with the image (stage 3).
`stages` is the plan of a search, and `simplify` rounds numbers and leaves maps out.

A grey picture of our own renderer needs, in this order: `stages/plan` and `base`, `stages/measure` with `bins` and
`measure/search` and `births`, `stages/image` with `image/objective` and `gauss_newton`, `moves`, and `simplify/loop`,
`rounding` and `simple_maps`. All other files are loaded for other pictures alone: `crossing`, `population` and `counts`
for linear grey levels, `growth` for shapes without a code, the rest for pictures that others drew.
"""
