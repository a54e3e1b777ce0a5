"""Simpler codes that draw the same.

`loop` says what a way to simpler codes is, and accepts what the ways propose. The ways: `removal` (maps that nobody
sees, that the camera makes up for, or that are not worth their price), `doubles`, `parents` (parents, and no contained
maps), `symmetry`, `flat` (shapes on a line) and `rounding`. `drawn` tries all of them on pictures that others drew.
"""
