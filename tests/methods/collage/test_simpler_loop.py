"""The loop for simpler codes: what it takes, in which order, and at what price."""

from types import SimpleNamespace

import pytest

from fractal_exp.methods.collage.simplify.loop import Draft, Price, Proposer, simplified
from fractal_exp.runtime.deadline import Deadline

OBJECTIVE = SimpleNamespace(subpixels=16)


def code(error, maps, objective=OBJECTIVE):
    return Draft(objective, SimpleNamespace(error=error, maps=range(maps)))


def then(*codes):
    """A way that proposes, for each code in turn, the ones that follow it."""
    return lambda fit: [other for each, other in zip(codes, codes[1:], strict=False) if each is fit]


def test_the_best_of_what_is_accepted_is_taken_as_long_as_any_is():
    first, good, better, best = code(1.0, 4), code(1.0, 3), code(0.9, 3), code(0.9, 2)
    following = {id(first): [good, better], id(better): [best]}

    def way(draft):
        return following.get(id(draft), [])

    assert simplified(first, [Proposer(way)], Price(share=0.1)) is best
    assert simplified(first, [Proposer(way, repeats=False)], Price(share=0.1)) is better
    assert simplified(first, [Proposer(way)], Price(share=0.1), Deadline(0)) is first


@pytest.mark.parametrize(("error", "price", "is_taken"), [
    (1.0, Price(), True), (1.01, Price(), False), (1.09, Price(share=0.1), True), (1.11, Price(share=0.1), False),
    (1.04, Price(error=0.05), True), (1.06, Price(error=0.05), False), (1.4, Price(worse=1.5), True),
    (1.6, Price(worse=1.5), False), (2.9, Price(worse=1.5, noise=2), True), (3.1, Price(worse=1.5, noise=2), False)])
def test_a_simpler_code_may_cost_what_its_map_is_worth(error, price, is_taken):
    start, other = code(1.0, 3), code(error, 2)
    assert (simplified(start, [Proposer(then(start, other))], price) is other) == is_taken


def test_errors_add_up_to_no_more_than_the_price_of_one_change():
    start, worse, still_worse = code(1.0, 3), code(1.4, 3), code(1.9, 3)
    assert simplified(start, [Proposer(then(start, worse, still_worse))], Price(worse=1.5)) is worse


def test_a_proposer_may_have_a_price_of_its_own_and_is_not_asked_twice_about_one_code():
    start, asked = code(1.0, 3), []
    way = Proposer(lambda fit: asked.append(fit) or [code(1.2, 2)], worse=1.1)
    assert simplified(start, [way, way], Price(worse=1.5)) is start
    assert asked == [start]


def test_a_polish_goes_on_until_the_code_is_accepted():
    start, rough, fine, finest = (code(error, 3) for error in (1.0, 2.0, 1.0, 0.5))
    seen = []

    def polish(fit, deadline):
        for each in fine, finest:
            seen.append(each)
            yield each

    assert simplified(start, [Proposer(then(start, rough), polish)], Price()) is fine and seen == [fine]
    assert simplified(start, [Proposer(then(start, rough), polish, early=True)], Price()) is start and seen == [fine]


def test_errors_by_cameras_of_other_subpixels_are_compared_as_angles():
    start, other = code(1.0, 3), code(4.0, 3, SimpleNamespace(subpixels=64))
    assert simplified(start, [Proposer(then(start, other))], Price()) is other


def test_a_code_must_stay_as_like_the_picture():
    objective = SimpleNamespace(subpixels=16, likenesses=lambda shown: shown.likenesses)

    def of(maps, *likenesses):
        return Draft(objective, SimpleNamespace(error=1.0, maps=range(maps), likenesses=likenesses))

    start, pale, other, off = of(3, 0.99, 0.98), of(2, 0.97, 0.98), of(2, 0.985, 0.96), of(2, 0.99, 0.94)
    for each, is_taken in (pale, False), (other, True), (off, False):
        assert (simplified(start, [Proposer(then(start, each), loss=0.01)], Price()) is each) == is_taken
