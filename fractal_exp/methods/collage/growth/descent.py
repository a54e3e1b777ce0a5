"""All maps and their weights, moved together until the collage of a picture shows the picture.

The collage theorem for measures (Barnsley and Elton 1988) says that maps whose images of a measure, mixed with their
probabilities, are close to the measure have an invariant measure that is close too. So maps move points of the
picture's measure at first. Then they move points of their own invariant measure, whose collage is the attractor itself,
along the true gradient of its error (see `adjoint`).
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from ....cameras.points import attractor_points
from ....ifs import affine
from ....ops.collage import pushforward
from ....ops.collage.reference import BETA_1, BETA_2, EPSILON, contract
from ....ops.filters import filtered
from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import generator
from ..state import WeightedMaps
from .adjoint import Adjoint
from .exposed import Exposed
from .inside import InsideSsim
from .paving import LARGEST
from .turns import closer, turned

SAMPLES = 1200          # of the measure that every map moves in a step
MATRIX_RATE = 0.004     # of matrix entries at the first step, for Adam
OFFSET_RATE = 0.0024    # of where the measure's mean goes, canvas units
MASS_RATE = 0.02        # of the logarithms of the weights
RATES_LEFT = 0.1        # share of the rates that is left at the last step
MEMORY = 0.75           # of the drawing that is compared, a moving average over steps: less noise, but it lags behind
OWN_FROM = 0.1          # share of the steps after which maps move points of their own measure
TURN_STEPS, TURNED_UNTIL = 5, 0.5   # from one try to turn every copy to the next, and share of the steps with tries
OWN_POINTS, OWN_STEPS = 200_000, 10   # how many of them, and for how many steps they are used
SIMILARITY = 0.05       # weight of SSIM inside the shape beside the squared error, each summed over pixels
SIMILARITY_STEPS = 2    # for which a slope of SSIM is used, since it takes as long as the rest of a step
BLUR, BLUR_PX = (0.25, 0.5, 0.25), 0.7   # of the drawing along both axes, and the Gaussian that is like it
LEAST_WEIGHT = 1e-6     # of a map
TOLD = 10               # steps from one set that is told to the next

Found = tuple[WeightedMaps, float]  # maps and weights, and the mass of their drawing


def descended(start: WeightedMaps, target: Exposed, steps: int, seed: int, deadline: Deadline = NO_DEADLINE,
              tell: Callable[[Found], object] = lambda found: None) -> Found:
    """The maps and weights after `steps` of Adam (Kingma and Ba 2015), and the mass of their drawing. The loss is the
    squared error of the collage, lightly blurred, less `SIMILARITY` times its SSIM inside the shape. tell: is called
    with those on the way, from the start on."""
    g, side = generator(seed, "descent"), target.side
    mean = target.points(SAMPLES, g).mean(0)
    linear, logs = start.maps[:, :4].clone().requires_grad_(), start.probabilities.log().requires_grad_()
    centre = affine.images(start.maps, mean[None])[:, 0].clone().requires_grad_()
    moving = {MATRIX_RATE: linear, OFFSET_RATE: centre, MASS_RATE: logs}
    groups = [{"params": [each], "lr": rate} for rate, each in moving.items()]
    adam = torch.optim.Adam(groups, MATRIX_RATE, (BETA_1, BETA_2), EPSILON)
    mass, similarity = target.mass or float(target.masses.sum()), InsideSsim(target.grey, target.shows)
    shares, towards, average = torch.full((SAMPLES, 1), 1 / SAMPLES), torch.zeros(side, side), None
    own, adjoint, begun = torch.empty(0, 2), Adjoint(side), deadline.used
    for k in deadline.during(range(steps)):
        done = max((k + 1) / steps, (deadline.used - begun) / (1 - begun))
        if k % TOLD == 0:
            tell(_found(linear, centre, logs, mean, target.mass, mass))
        if done <= OWN_FROM:
            points = target.points(SAMPLES, g)
        else:
            if not len(own) or k % OWN_STEPS == 0:
                own = attractor_points(_maps(linear, centre, mean), logs.detach().softmax(0), OWN_POINTS,
                                       int(torch.randint(2**31, (), generator=g)))
            points = own[torch.randint(len(own), (SAMPLES,), generator=g)]
        samples = torch.cat([points - mean, shares], 1).requires_grad_(len(own) > 0)
        with torch.enable_grad():
            weights = logs.exp() if target.mass is None else logs.softmax(0)  # the sum is 1 if the mass is known
            drawn = mass * pushforward(torch.cat([linear, centre], 1)[None], weights[None], samples, side)[0]
        with torch.no_grad():
            drawing = filtered(drawn, BLUR)
            average = drawing if average is None else average.lerp(drawing, max(1 - MEMORY, 1 / (k + 1)))
            shown = target.curve.grey(average) * target.shows
            if k % SIMILARITY_STEPS == 0:
                towards = SIMILARITY * similarity.slope(shown)
            slope = 2 * (shown - target.grey) - towards
            slope = filtered(slope * target.slope(average) * target.shows, BLUR)
            slope += adjoint.echo()
        adam.zero_grad()
        drawn.backward(slope)
        if samples.grad is not None:
            adjoint.learn(points, samples.grad[:, 2] / (mass * float(weights.detach().sum())))
        if k and k % TURN_STEPS == 0 and done < TURNED_UNTIL:
            maps, known = torch.cat([linear, centre], 1).detach(), samples.detach()
            tried = contract(torch.cat([turned(maps[:, :4], known[:, :2], g), maps[:, 4:]], 1), LARGEST)
            better = closer(tried, maps, mass * weights.detach(), known, drawing, target, BLUR)
            linear.data[better], adam.state[linear]["exp_avg"][better] = tried[better, :4], 0
            assert linear.grad is not None
            linear.grad[better] = 0  # it is of the copies before
        for group, rate in zip(adam.param_groups, moving, strict=True):
            group["lr"] = rate * RATES_LEFT**done
        adam.step()
        with torch.no_grad():
            linear.copy_(contract(torch.cat([linear, centre], 1), LARGEST)[:, :4])
    return _found(linear, centre, logs, mean, target.mass, mass)


def _found(linear: Tensor, centre: Tensor, logs: Tensor, mean: Tensor, known: float | None, mass: float) -> Found:
    """The set of these parameters. known: the mass of the whole, if it is given; mass: what weights are shares of."""
    weights = logs.detach().exp().clamp_min(LEAST_WEIGHT)
    total = mass if known else mass * float(weights.sum())
    return WeightedMaps(_maps(linear, centre, mean), weights / weights.sum()), total


def _maps(linear: Tensor, centre: Tensor, mean: Tensor) -> Tensor:
    """Maps (N,6) of these matrices (N,4) that send the mean to `centre` (N,2)."""
    return affine.sending(linear.detach().unflatten(1, (2, 2)), mean, centre.detach())
