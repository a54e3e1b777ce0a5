"""Images as they come: read, checked, centred, written."""

from .placement import Placement
from .reading import ReadImage, read_target, write_image

__all__ = ["Placement", "ReadImage", "read_target", "write_image"]
