"""The task of `fractal-train`: one fit from configuration to scores."""

from __future__ import annotations

import copy
import hashlib
import json
import shlex
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf

from ..errors import InputError
from ..evaluation import Perceptual
from ..images.painted import Painted
from ..images.pixels import write_image
from ..inversion import Inversion, Work, coloured, conclude, reconstruct, write
from ..inversion.writing import PAGE
from ..methods import WITHOUT_CODE
from ..methods.base import CodeReconstruction, Method, Reconstruction
from ..methods.super_resolution.enlarged import Enlarged
from ..rendering.colour import on_ground
from ..rendering.sheets import comparison_strip
from ..rendering.still import render
from ..runtime import threads
from ..runtime.extras import need
from ..runtime.files import write_atomically
from ..studies.judging import Judgement, check_options, finds_truth, judge, judge_course
from ..targets import Target
from ..tracking import Tracker
from ..verdict import Verdict
from . import configuration, interruption
from .composed import FOR_PICTURE
from .folders import CODE, ENLARGED, FitFolder
from .progress import Reporter
from .runs import NoRuns
from .words import plainest

# Target, method and loss hold what `picture`, `seconds` and `regularizer_weight` say. Colours are a part of a fit that
# has them.
NOT_PART_OF_A_FIT = ("picture", "seconds", "colour", "output", "study", "name", "resume", "tracking", "threads",
                     "checkpoint_every", "evaluation", "sweep", configuration.PARENT, "task", "pretraining", "weights",
                     "network_side", "network_width", "regularizer_weight", "preset")


METHOD_TITLES = {"collage": "collage search", "chaotic": "the paper's method",
                 "collage-chaotic": "the paper's method, begun with collage search",
                 "evolutionary": "evolutionary programming", "cuckoo": "cuckoo search",
                 "learningfractals32": "Learning Fractals on 32²", "learningfractals256": "Learning Fractals on 256²",
                 "neuralregression": "neural regression", "superresolution": "super-resolution",
                 "amortized": "amortised set prediction",
                 "amortized-chaotic": "the paper's method, begun with amortised set prediction"}


def fit(config: DictConfig) -> dict[str, float]:
    """Run one fit as configured and return its scores; everything it makes lies in its folder and its MLflow run.

    Raises `InputError` on anything a user can mend, before any work.
    """
    with interruption.not_lost(), ExitStack() as held:  # the lock of the fit's folder
        return _fit(config, held)


def _fit(config: DictConfig, held: ExitStack) -> dict[str, float]:
    given = copy.deepcopy(config)
    config = configuration.resolve(config)
    check_options(config.evaluation)
    threads.use(config.threads)
    settings = configuration.plain(config)
    source = configuration.build(config.target)
    method: Method = configuration.build(config.method)
    runs: NoRuns = configuration.build(config.tracking)
    if config.colour:
        _check_method(config.method["_target_"])
        need("skimage")
    perceptual = Perceptual.load(config.perceptual, config.perceptual_weights)
    target = source.load(config.resolution)
    painted = _painted(target) if config.colour else None
    method.check(target.read)
    if target.truth is None:  # judged at its own resolution
        perceptual.check(target.image.shape[-1])
    else:
        perceptual.check(config.evaluation.resolution, "evaluation.resolution")
    identity = _identity(settings, target, painted, method)

    folder = FitFolder.open(Path(config.output) / config.study, config.name or _name(config, source.label, identity))
    held.enter_context(folder.alone())
    scores = folder.finished_scores(identity | {"evaluation": settings["evaluation"]})
    if config.resume and scores:
        runs.check_kept(folder, settings)
        print(f"{folder.path} holds this fit, finished; resume=false fits it again")
        return scores
    if scores:
        print(f"{folder.path} held this fit, finished; it is fitted again (resume=true takes it as it is)")
    checkpoint = folder.checkpoint_of("fit", config.checkpoint_every, identity, config.resume)
    _announce(config, source.label, target)

    with runs.start(folder, settings, identity, source.label) as run, interruption.not_lost():  # KILLED, not FAILED
        folder.begin(OmegaConf.to_yaml(config))
        kept = folder.keep_target(target.image, target.truth)
        run.artifact(kept.name, kept)
        with Reporter(run, folder) as reporter:
            work = reconstruct(target.read, method, seed=config.seed, on_step=reporter,
                               checkpoint=replace(checkpoint, first=run.secure))
        reconstruction = work.found
        found = _keep_found(folder, run, reconstruction)  # before anything else can go wrong
        inversion = _keep_inversion(folder, run, work, target, painted, settings)
        sweep = config.sweep or {}
        judgement = judge(reconstruction, target, settings["evaluation"], perceptual, work.seconds,
                          ceiling=bool(sweep.get("ceiling")), in_frame=bool(sweep.get("in_frame")))
        has_camera = isinstance(reconstruction, CodeReconstruction) and reconstruction.camera is not None
        if target.truth is None and inversion is not None and has_camera:
            judgement = _through_camera(judgement, inversion)
        if painted is not None and inversion is not None and inversion.code.colours is not None:
            judgement = _with_colours(judgement, inversion, painted)
        _keep(folder, run, judgement)
        if sweep.get("course") and target.truth is not None:
            points = judge_course(work.course, target.truth, settings["evaluation"])
            f1 = float(judgement.per_view["f1"].iloc[0])
            run.artifact("course.json", folder.keep_course(points, work.seconds, f1))
    # Only now: a fit that is killed while its last numbers are on their way must not count as finished.
    folder.finish(identity | {"evaluation": settings["evaluation"]}, judgement.scores)
    _conclude(judgement, work.stopped, inversion, found, folder, runs.where(settings), given)
    return judgement.scores


def _identity(settings: dict[str, Any], target: Target, painted: Painted | None, method: Method) -> dict[str, Any]:
    """What two fits have in common if one can take the other's checkpoint or scores."""
    identity = {key: value for key, value in settings.items() if key not in NOT_PART_OF_A_FIT}
    if painted is not None:
        identity |= {"colour": True, "target_colours": _digest(painted.seen.tobytes())}
    identity["target_image"] = _digest(target.image.numpy().tobytes())
    if fingerprint := method.fingerprint():
        identity["fingerprint"] = fingerprint[:16]
    return identity


def _conclude(judgement: Judgement, stopped: str, inversion: Inversion | None, found: Path | None, folder: FitFolder,
              where: str | None, given: DictConfig) -> None:
    """Print the scores, and where everything lies."""
    print(f"  {judgement.describe()}")
    print(f"  stopped    {stopped}")
    if inversion is not None:
        print(f"  verdict    {inversion.verdict.words}")
        if remedy := may_help(inversion.verdict, given):
            print(f"  may help   {remedy}")
    if found is not None:
        print(f"  {found.stem:10} {found}")
    print(f"  pictures   {folder.views}")
    if where:
        print(f"  dashboard  {where}")


def may_help(verdict: Verdict, given: DictConfig) -> str:
    """What may help, as the command line with one setting changed; in words where it is nothing to set. Empty where no
    command made the fit, or where the fit has no such setting or would refuse the value.

    given: the configuration before it was resolved.
    """
    if not verdict.change:
        return verdict.remedy
    if not HydraConfig.initialized() or given.sweep:
        return ""
    [(key, value)] = verdict.change.items()
    words = plainest(configuration.words_of_a_fit(), FOR_PICTURE)
    keys = [word.split("=", 1)[0].lstrip("+") for word in words]
    parts = {"": given, "target.": given.target, **({"init.": given.init} if given.init else {
        "method.": given.method, "model.": given.model if "model" in given.method else {}})}
    found = [prefix + key for prefix, part in parts.items() if key in part]
    setting = next((name for name in found if name in keys), found[0] if found else "")
    if not setting or not _is_taken(given, setting, value):
        return ""
    kept = [word for word, key in zip(words, keys, strict=True) if key not in (setting, "name", "resume")]
    text = f"{value:g}" if isinstance(value, float) else str(value).lower()
    return shlex.join(["fractal-train", *kept, f"{setting}={text}"])


def _is_taken(given: DictConfig, setting: str, value: Any) -> bool:
    """Whether a fit with another value of a setting would begin: trained weights know one number of maps."""
    changed = copy.deepcopy(given)
    OmegaConf.update(changed, setting, value)
    try:
        changed = configuration.resolve(changed)
        target = configuration.build(changed.target).load(changed.resolution)
        configuration.build(changed.method).check(target.read)
    except InputError:
        return False
    return True


def _keep_found(folder: FitFolder, run: Tracker, reconstruction: Reconstruction) -> Path | None:
    """Put the code, or the enlarged picture, into the folder and into the run; its path."""
    if isinstance(reconstruction, CodeReconstruction):
        kept = reconstruction.code.save(folder.path / CODE)
    elif isinstance(reconstruction, Enlarged):
        kept = write_image(folder.path / ENLARGED, reconstruction.image)
    else:
        return None
    run.artifact(kept.name, kept)
    return kept


def _keep_inversion(folder: FitFolder, run: Tracker, work: Work, target: Target, painted: Painted | None,
                    settings: dict[str, Any]) -> Inversion | None:
    """Put all that is known of a code, with the picture's colours if it is to have them, into the folder and into the
    run, as `fractal-invert` does; None if the method found no code."""
    if not isinstance(work.found, CodeReconstruction):
        return None
    options = {key: value for key, value in settings["method"].items() if not key.startswith("_")}
    inversion = conclude(work, target.read, name=configuration.method_name(settings["method"]), options=options,
                         seed=settings["seed"], truth=None if target.truth is None else
                         finds_truth(work.found.code, target.truth, settings["evaluation"]))
    if painted is not None:
        inversion = coloured(inversion, painted, settings["seed"])
        if inversion.code.colours is None:
            print(f"  {inversion.notes[-1]}")
    written = write(inversion, folder.path)
    for name in written:
        run.artifact(name, folder.path / name)
    if PAGE not in written:
        print("  no page    the code has more maps than a page shows")
    return inversion


def _through_camera(judgement: Judgement, inversion: Inversion) -> Judgement:
    """The judgement with pictures of what the camera that was found draws of the code, as a person compares it with the
    input. The scores are those of the attractor."""
    drawn = inversion.redrawn()
    caption = f"whole, F1 {inversion.likeness.f1_1px:.3f} within a pixel"
    strip = comparison_strip(drawn[None], inversion.target.image[None], [caption])
    return replace(judgement, pictures=judgement.pictures | {"result": drawn, "comparison": strip})


def _with_colours(judgement: Judgement, inversion: Inversion, painted: Painted) -> Judgement:
    """The judgement with the colours' error, unless no pixel is lit in both, among its scores, and among its pictures
    `coloured`: the picture and, on its right, the code's rendering on the picture's ground."""
    ground = tuple(painted.ground.clip(0, 1).tolist())
    drawn = on_ground(render(inversion.code, resolution=len(painted.seen), mode="colour"), ground).numpy()
    error = {} if (colour := inversion.likeness.colour) is None else {"eval/ciede2000": colour}
    return replace(judgement, scores=judgement.scores | error,
                   pictures=judgement.pictures | {"coloured": np.hstack([painted.seen.clip(0, 1), drawn])})


def _check_method(class_path: str) -> None:
    """Raise `InputError` if a method, by the dotted path of its class, finds no code to give colours to."""
    for name, instead in WITHOUT_CODE.items():
        if name in class_path.split("."):
            raise InputError(f"colour=true gives colours to the maps of a code, and method={name} finds none: it "
                             f"{instead}; take another method, or leave colour out")


def _painted(target: Target) -> Painted:
    """The colours of a target's picture. Raises `InputError` if it is none, or a grey one."""
    if target.read.source is None:
        raise InputError("colour=true takes the colours of a picture, and this target is drawn without any; give "
                         "picture=FILE, or leave colour out")
    painted = Painted.of(target.read)
    if painted.is_grey:
        raise InputError(f"colour=true needs a picture in colour, and the shape in {target.read.source} is grey; "
                         "leave colour out, or give another picture")
    return painted


def _name(config: DictConfig, label: str, identity: Mapping[str, Any]) -> str:
    """What a reader looks for, and a digest of all the rest, so that no fit lands in another one's folder."""
    method = configuration.method_name(config.method)
    digest = _digest(json.dumps(identity, sort_keys=True).encode())[:6]
    return f"{label}-{method}-{config.variant}-{config.scale}-seed{config.seed}-{digest}"


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def _announce(config: DictConfig, label: str, target: Target) -> None:
    method = METHOD_TITLES.get(configuration.method_name(config.method), configuration.method_name(config.method))
    variant = "" if config.variant == "full" else f", {config.variant}"
    job = f" ({own})" if (own := configuration.own_words()) else ""
    print(f"{label}{job}: {method}{variant}, {config.resolution}² pixels, {config.scale} scale; "
          f"{'; '.join(target.read.notes)}")
    if config.perceptual == "none" and "perceptual" in config.method.get("objective", {}).get("terms", {}):
        print("  no perceptual term in this objective (perceptual=none); perceptual=fractal adds one")


def _keep(folder: FitFolder, run: Tracker, judgement: Judgement) -> None:
    """Put pictures and scores into the folder and into the run."""
    for name, image in judgement.pictures.items():
        write_image(folder.views / f"{name}.png", image)
        run.image(name, image)
    run.image("strip", judgement.pictures["comparison"], 0)  # among the charts too, where runs are compared
    write_atomically(folder.path / "per_view.csv", judgement.per_view.to_csv(index=False))
    run.table("per_view.json", judgement.per_view)
    run.log(judgement.scores | judgement.trivial | judgement.counts)
