"""Simpler codes that draw the same.

`loop` says what a way to simpler codes is, accepts what the ways propose, and leaves out maps that are not worth their
price. The other ways: `rounding`, and on pictures that others drew `removal` (maps that nobody sees or needs, doubles),
`parents` (parents, and no contained maps), `symmetry` and `flat` (shapes on a line). `drawn` tries all of them.
"""
