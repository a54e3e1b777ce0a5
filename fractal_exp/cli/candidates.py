"""What `fractal-evaluate` is to judge: codes from files, folders and runs, each with its truth or its picture.

What a fit left behind is read as data: nothing that a file or a tracking server says is called, opened or resolved.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from .. import codes, tracking
from ..errors import InputError
from ..ifs.code import IFS
from ..images.reading import ReadImage
from ..inversion.result import INVERSION
from ..runtime.files import LARGEST_JSON, parse_json, read_file
from ..suite import SUITE_COUNT, SUITE_SEED, random_suite
from .code_names import file_and_name, read_code
from .folders import CODE, CONFIG, ENLARGED, FINISHED, PICTURE, TRUTH

LARGEST_SIDE = 8192       # pixels, of a picture that a fit left
LARGEST_PICTURE = 2**28   # bytes of its file, which 16-bit noise of that size just about needs

Read = Callable[[str], bytes | None]  # a file of a fit by its name, None if there is none


@dataclass(frozen=True)
class Aim:
    """What a fit was to find: the `truth` that drew its target, or the `picture` (R,R) and the `file` it was kept in,
    or both where the authors published both; nothing, if the fit was of a picture that is not kept. target: the
    picture with all that is known of it, if the user named it."""

    truth: IFS | None = None
    picture: Tensor | None = None
    file: str | None = None
    target: ReadImage | None = None


@dataclass(frozen=True, eq=False)
class Submission:
    """A recovered code, what to call it, and what it was to be: a code, or the picture that it was fitted to."""

    name: str
    code: IFS
    aim: Aim


def gather(sources: Sequence[str], truth: str | Aim | None, output: str | Path) -> list[Submission]:
    """All codes that `sources` name: what `read_code` knows, folders of JSON files, folders of fits and of inversions,
    run:ID in the store of `output`.

    truth: a code (`read_code`) for all of them, a classic with its probabilities by area, as targets are drawn unless
    told otherwise; a folder with a JSON of the same name for each; suite or suite:all:SEED for the fractal of the
    random suite that the digits of each name tell; an aim of all; None for what the fits themselves say. Raises
    `InputError` if a code or its truth cannot be found, or two codes have one name.
    """
    found = [candidate for source in sources for candidate in _candidates(source, truth, output)]
    names = [candidate.name for candidate in found]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"two codes are called {name!r}; evaluate them one after another")
    return found


def without_code(sources: Sequence[str]) -> tuple[list[str], list[str]]:
    """The names of the fits in the folders among `sources` that have no code to judge: of those that are not finished,
    and of those whose method finds none."""
    folders = [Path(source).absolute() for source in sources if not source.startswith("run:")]
    begun = [fit.name for folder in folders for fit in _fits(folder, CONFIG) if not (fit / FINISHED).exists()]
    return begun, [fit.name for folder in folders for fit in _fits(folder, FINISHED) if _found_no_code(fit)]


def _fits(folder: Path, file: str) -> list[Path]:
    """The folders of fits that hold this file: the folder itself, or those in it."""
    return [folder] if (folder / file).exists() else sorted(path.parent for path in folder.glob(f"*/{file}"))


def _found_no_code(fit: Path) -> bool:
    return (fit / ENLARGED).exists() and not (fit / CODE).exists()


def _candidates(source: str, truth: str | Aim | None, output: str | Path) -> Iterator[Submission]:
    if source.startswith("run:"):
        run_id = source.removeprefix("run:")
        yield _fit(run_id, f"run {run_id}", _run_reader(run_id, output), truth)
        return
    path, entry = file_and_name(source)
    path = path.absolute()
    if not path.is_dir():
        name = re.sub(r"[^\w.-]+", "-", path.stem if entry is None else f"{path.stem}:{entry}")
        yield Submission(name, read_code(source), _aim(name, truth))
        return
    if (path / INVERSION).exists() and not (path / FINISHED).exists():
        yield Submission(path.name, IFS.load(path / CODE), _aim(path.name, truth))
        return
    finished = _fits(path, FINISHED)
    coded = [fit for fit in finished if not _found_no_code(fit)]
    if finished and not coded:
        raise InputError(f"{path} holds no code, but images that were enlarged; fractal-train has judged them, see "
                         "per_view.csv beside them")
    for fit in coded:
        yield _fit(fit.name, str(fit), _folder_reader(fit), truth)
    files = [] if finished else sorted(path.glob("*.json"))
    if not finished and not files:
        raise InputError(f"{path} holds neither codes (*.json) nor finished fits (*/{FINISHED})")
    for file in files:
        yield Submission(file.stem, IFS.load(file), _aim(file.stem, truth))


def _fit(name: str, where: str, read: Read, truth: str | Aim | None) -> Submission:
    code = _code(read, CODE, where)
    if code is None:
        raise InputError(f"{where} holds no {CODE}")
    return Submission(name, code, read_aim(read, where) if truth is None else _aim(name, truth))


def _most_bytes(name: str) -> int:
    """How large a file of a fit may be; a `Read` refuses larger ones without reading them."""
    return LARGEST_PICTURE if name.endswith(".png") else LARGEST_JSON


def _folder_reader(folder: Path) -> Read:
    def read(name: str) -> bytes | None:
        path = folder / name
        return read_file(path, "the fit's file", _most_bytes(name)) if path.exists() else None
    return read


def _run_reader(run_id: str, output: str | Path) -> Read:
    uri = tracking.kept_runs(output)

    def read(name: str) -> bytes | None:
        try:
            return tracking.read_artifact(uri, run_id, name, _most_bytes(name))
        except tracking.NoArtifact:
            return None
        except InputError:
            raise
        except Exception as error:  # MLflow's own kinds, by version
            raise InputError(f"cannot read run {run_id!r}: {str(error).splitlines()[0]}") from error
    return read


def _code(read: Read, name: str, where: str) -> IFS | None:
    """The code in one file of a fit, None if there is no such file. Raises `InputError` naming the file."""
    data = read(name)
    try:
        return None if data is None else IFS.from_json(parse_json(data, "it"))
    except InputError as error:
        raise InputError(f"{where}/{name}: {error}") from None


def read_aim(read: Read, where: str) -> Aim:
    """What the fit of these files was to find: from truth.json or target.png. Raises `InputError` naming a file that
    is damaged."""
    truth = _code(read, TRUTH, where)
    if truth is not None:
        return Aim(truth)
    if (data := read(PICTURE)) is not None:
        return Aim(None, fit_picture(data, f"{where}/{PICTURE}"), PICTURE)
    return Aim()


def fit_picture(data: bytes, where: str) -> Tensor:
    """A square grey PNG, perhaps with the same grey in all three colours, as (R,R) float32 in [0,1]. Raises
    `InputError`, which begins with `where`, on anything else."""
    try:
        with Image.open(io.BytesIO(data), formats=["PNG"]) as picture:
            if picture.width != picture.height or picture.width > LARGEST_SIDE:
                raise InputError(f"{where}: a fit's picture is square and at most {LARGEST_SIDE} px a side, got "
                                 f"{picture.width}×{picture.height}")
            pixels = np.asarray(picture)
    except InputError:
        raise
    except Exception as error:  # Pillow's own kinds, by what is wrong
        reason = (str(error).splitlines() or [type(error).__name__])[0][:200]
        raise InputError(f"{where}: this is no PNG that can be read: {reason}") from None
    if pixels.ndim == 3 and pixels.shape[2] == 3 and (pixels == pixels[..., :1]).all():
        pixels = pixels[..., 0]
    if pixels.ndim != 2 or pixels.dtype not in (np.uint8, np.uint16, np.int32):
        raise InputError(f"{where}: a fit's picture is grey, of 8 or 16 bits")
    white = 255 if pixels.dtype == np.uint8 else 65535
    return torch.from_numpy((pixels.astype(np.float64) / white).clip(0, 1).astype(np.float32))


def _aim(name: str, truth: str | Aim | None) -> Aim:
    if isinstance(truth, Aim):
        return truth
    if truth is None:
        raise InputError(f"what should {name} be? Name its truth: --truth suite, a folder, or a code")
    if re.fullmatch(r"suite(:all:\d+)?", truth):
        return Aim(_of_the_suite(name, int(truth.rpartition(":")[2]) if ":" in truth else SUITE_SEED))
    if Path(truth).is_dir() and not (Path(truth) / CODE).exists():
        return Aim(IFS.load(Path(truth) / f"{name}.json"))
    code = read_code(truth)
    return Aim(replace(code, probabilities=None) if truth in codes.names() and not Path(truth).exists() else code)


def _of_the_suite(name: str, seed: int) -> IFS:
    digits = re.findall(r"\d+", name)
    if not digits or int(digits[-1]) >= SUITE_COUNT:
        raise InputError(f"{name!r} does not end in the number of a fractal of the suite, as in 007.json")
    return random_suite(int(digits[-1]) + 1, seed)[-1]
