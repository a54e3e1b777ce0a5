"""Search by renderings that are compared with the image: stage 3."""
