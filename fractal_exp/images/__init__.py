"""Images as they come: read, checked, centred, written."""

from .reading import Target, read_target, write_image

__all__ = ["Target", "read_target", "write_image"]
