"""Read, check, centre and write images."""

from .pixels import write_image
from .placement import Placement
from .reading import ReadImage, read_target

__all__ = ["Placement", "ReadImage", "read_target", "write_image"]
