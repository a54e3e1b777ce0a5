"""Read, check, centre and write images."""

from .placement import Placement
from .reading import ReadImage, read_target, write_image

__all__ = ["Placement", "ReadImage", "read_target", "write_image"]
