"""What flam3's own program draws of a `.flame` file."""

import os
import shutil
import subprocess

import numpy as np
import pytest
import torch
from PIL import Image
from skimage.color import deltaE_ciede2000, rgb2lab

from fractal_exp import render
from fractal_exp.ifs.formats.flame import camera_of

SIDE = 256
DRAWS = pytest.mark.skipif(shutil.which("flam3-render") is None,
                           reason="needs flam3-render: apt-get install flam3-utils")


def drawn(path, side=SIDE, index=0, **settings):
    """What flam3 draws of a file's flame, (side, side); it takes the frame's larger side to be 1024 or so."""
    out = path.with_name("drawn")
    size = float(path.read_text().split('size="')[1 + index].split()[0])
    subprocess.run(["flam3-render"], check=True, capture_output=True, timeout=300, env=os.environ | {
        "in": str(path), "prefix": str(out), "ss": str(side / size), "isaac_seed": "fern", "nthreads": "1"} | settings)
    pictures = sorted(path.parent.glob("drawn*.png"))
    return torch.from_numpy(np.asarray(Image.open(pictures[index]).convert("L"), np.float32))


def difference(path, code, own=None):
    """The mean CIEDE2000 between flam3's colours of a file and a code's, where both have points."""
    drawn(path, 128, transparency="1")
    flam3 = np.asarray(Image.open(next(path.parent.glob("drawn*.png"))), float) / 255
    own = (render(code, camera_of(code), resolution=128, mode="colour") if own is None else own).numpy()
    both = (flam3[..., 3] > 0) & (own[..., 3] > 0)
    assert both.sum() > 1000
    return float(deltaE_ciede2000(rgb2lab(flam3[both][:, :3]), rgb2lab(own[both][:, :3])).mean())
