"""A camera of each kind that a picture may be said to have."""

from fractal_exp.cameras.camera import Camera

SIDE = 96
PIXEL = 2 / SIDE
CAMERAS = {
    "density": Camera("density"), "linear": Camera("linear", blur=1.5 * PIXEL),
    "dots": Camera("dots", gain=0.2, blur=0.5 * PIXEL),
    "tonemapped": Camera("tonemapped", gain=0.2, gamma=2.2, blur=0.5 * PIXEL),
    "coverage": Camera("coverage", tile=0.0, pen=PIXEL, blur=0.5 * PIXEL), "binary": Camera("binary"),
}
