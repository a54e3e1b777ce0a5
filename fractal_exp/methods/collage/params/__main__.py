"""Write Hydra's file of collage search."""

from __future__ import annotations

from ....runtime.params import as_yaml
from . import CollageParams


def hydra_config() -> str:
    """conf/method/collage.yaml: `python -m fractal_exp.methods.collage.params > conf/method/collage.yaml`."""
    return f"""# Collage search finds the maps of a code one by one, from the measure that the image shows.
# This file is generated from the parameter classes in fractal_exp/methods/collage. Do not edit it.
_target_: fractal_exp.methods.collage.method.Collage
_convert_: all
seconds: ${{seconds}}
seed: ${{seed}}
device: ${{device}}
previews: 10
{as_yaml(CollageParams(), {})}
"""


if __name__ == "__main__":
    print(hydra_config(), end="")
