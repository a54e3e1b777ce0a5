"""A code as a page that flies into it: one HTML file that asks no other file and no network for anything."""

from .. import ifs as ifs  # first, since codes are completed with parts of this folder
