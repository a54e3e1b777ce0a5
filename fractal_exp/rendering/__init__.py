"""Any view of a code at any zoom: stills, tiles, sheets, films."""

from .. import ifs as ifs  # first, since codes are completed with parts of this folder
