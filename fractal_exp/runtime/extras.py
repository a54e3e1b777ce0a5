"""What this package can do only with one of its extras installed (pyproject.toml says what each of them brings)."""

from __future__ import annotations

from importlib.util import find_spec

from ..errors import InputError

EXTRAS = {  # the libraries that are imported where they are used -> the extra that brings them
    "hydra": "study", "kornia": "study", "matplotlib": "study", "mlflow": "study", "omegaconf": "study",
    "pandas": "study", "psutil": "study", "pyarrow": "study", "skimage": "study", "tenacity": "study", "yaml": "study",
    "lpips": "perceptual", "torchvision": "perceptual",
    "imageio": "video", "imageio_ffmpeg": "video",
    "anywidget": "notebook",
    "starlette": "studio", "uvicorn": "studio", "websockets": "studio",
}


def need(*libraries: str) -> None:
    """Raise `InputError`, naming the extra to install, unless these libraries are installed. Nothing is imported."""
    for library in libraries:
        if find_spec(library) is None:
            raise InputError(f"{library} is not installed; {remedy(library)}")


def remedy(library: str) -> str:
    """The command that installs a library of an extra, in words."""
    return f"pip install 'fractal-exp[{EXTRAS[library]}]' brings it"
