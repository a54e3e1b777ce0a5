"""The figures of the paper's tables 3 and 4. The paper drew its suite without a seed, so that ours is another sample of
the same distribution; its authors offer theirs, with the codes that they found, on the project page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

COLUMNS = ("f1", "iou", "psnr", "ssim", "lpips")
FULL = "full"   # the row of the method without an ablation
AS_PUBLISHED = {"chaotic_released": "chaotic"}   # our row that does what the published one did, under another name


@dataclass(frozen=True)
class PublishedTable:
    """A table of the paper: its source, and for each row the scores (in the order of COLUMNS) and any seconds.

    A row has the name of our row with the same meaning. `chaotic` is the paper's method; where it was also run as in
    `AS_PUBLISHED`, that row stands for it.
    """

    source: str
    rows: Mapping[str, tuple[float, float, float, float, float]]
    seconds: Mapping[str, float]


TABLES = {
    "ablations": PublishedTable(
        "Djeacoumar et al. 2025, Table 4: 50 fractals at 1024², 15 000 iterations, LPIPS-AlexNet; another sample of "
        "the same distribution",
        {
            "naive": (.583, .467, 9.12, .481, .431),
            "no_multisampling": (.561, .445, 9.16, .481, .441),
            "no_mip": (.363, .286, 9.08, .525, .512),
            "no_ssim": (.611, .483, 8.41, .436, .454),
            "no_perceptual": (.544, .440, 8.86, .466, .511),
            "no_regularizer": (.596, .474, 8.66, .449, .476),
            "moments": (.542, .408, 4.17, .170, .818),
            "no_annealing": (.594, .468, 8.72, .459, .441),
            "no_gradients": (.496, .377, 7.14, .296, .736),
            "noisy_gradients": (.578, .455, 8.93, .471, .442),
            "full": (.611, .488, 9.23, .482, .415),
        },
        {},
    ),
    "comparisons": PublishedTable(
        "Djeacoumar et al. 2025, Table 3: 100 fractals, 700 images at 1024², one GPU; another sample of the same "
        "distribution",
        {
            "super_resolution": (.917, .854, 16.30, .714, .239),
            "learning_fractals_32": (.121, .080, 6.59, .436, .656),
            "learning_fractals_256": (.553, .430, 6.78, .348, .648),
            "evolutionary": (.621, .492, 6.49, .289, .745),
            "cuckoo": (.490, .351, 3.43, .140, .825),
            "neural_regression": (.161, .106, 5.33, .358, .709),
            "chaotic": (.691, .572, 8.91, .449, .428),
        },
        {"super_resolution": 12, "learning_fractals_32": 480, "learning_fractals_256": 2100, "evolutionary": 10800,
         "cuckoo": 32400, "neural_regression": 0.016, "chaotic": 3300},
    ),
}
