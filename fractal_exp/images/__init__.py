"""Images as they come: read, checked, centred, written."""

from .placement import Placement
from .reading import Target, read_target, write_image

__all__ = ["Placement", "Target", "read_target", "write_image"]
