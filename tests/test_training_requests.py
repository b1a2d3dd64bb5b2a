"""Which object of a training example belongs to which of the requested planes."""

import numpy as np

from training.requests import NOT_COUNTED, draw_request, targets_of

# Median plane, planes that it reaches over, share of the film.
NEAR, FAR, BETWEEN, LEANING, AWAY = (
    (11.0, 3.0, 0.1),
    (39.0, 3.0, 0.1),
    (19.0, 3.0, 0.1),
    (12.0, 20.0, 0.1),
    (60.0, 2.0, 0.1),
)


def test_an_object_belongs_to_the_nearest_requested_plane_or_to_none() -> None:
    objects = np.array([NEAR, FAR, BETWEEN, LEANING, AWAY], np.float32)
    targets = targets_of(objects, np.array([10.0, 40.0]))
    assert targets.tolist() == [2, 0, 1, NOT_COUNTED, NOT_COUNTED, 2]
    assert (targets_of(objects, np.zeros(0)) == NOT_COUNTED).all()


def test_walls_are_requested_as_often_as_not_and_planes_stay_within_the_sweep() -> None:
    objects = np.array([NEAR, (50.0, 4.0, 0.6)], np.float32)
    rng = np.random.default_rng(1)
    requests = [draw_request(objects, np.array([10.0, 90.0]), 64, rng) for _ in range(2000)]
    planes = [request.planes for request in requests]
    assert all(((each >= 0) & (each <= 63)).all() for each in planes)
    # A request is left out in 15 % of examples, and the wall in half of the others.
    share = np.mean([50.0 in each for each in planes])
    assert abs(share - 0.85 / 2) < 4 * np.sqrt(0.25 / 2000)
    with_all = [request for request in requests if request.planes.tolist() == [10.0, 50.0]]
    assert all(request.targets.tolist() == [2, 0, 1] for request in with_all)
