"""Places from which the light of cubes is looked at."""

import numpy as np

from runtime import probe_places


def test_places_share_a_grid_as_fine_as_their_number_allows(rng):
    solid = np.zeros((20, 20, 20), bool)
    places = rng.uniform(2, 18, (1000, 3))
    found = probe_places.spread(places, solid)
    assert len(found.points) <= probe_places.MOST
    np.testing.assert_allclose(found.weight.sum(axis=1), 1)
    # What is linear nearly stays: the grid's spacing is 9.5 cells, measured 3.4
    assert np.abs(found.between(found.points) - places).max() < 4.75
    # Some of them find what all do
    some = probe_places.spread(places[::9], solid, places)
    np.testing.assert_allclose(
        some.between(some.points), found.between(found.points)[::9], atol=1e-9
    )
    # A small step of a sprite is a small step of its light
    near = probe_places.spread(places + 1e-6, solid)
    if len(near.points) == len(found.points):
        step = near.between(near.points) - found.between(found.points)
        assert np.abs(step).max() < 1e-4
    few = probe_places.spread(places[:7], solid)
    np.testing.assert_array_equal(few.points, places[:7])
    # The same places in another order are lit the same
    other = probe_places.spread(places[::-1], solid)
    np.testing.assert_array_equal(other.points, found.points)


def test_places_in_walls_look_from_the_nearest_gap():
    solid = np.ones((5, 5, 5), bool)
    solid[2, 2, 3:] = False
    found = probe_places.freed(np.array([[2.9, 2.5, 2.5], [4.2, 2.1, 2.2], [9.0, 0, 0]]), solid)
    np.testing.assert_allclose(found, [[3.5, 2.5, 2.5], [4.2, 2.1, 2.2], [9.0, 0, 0]])
    # Deep inside there is none
    solid[:] = True
    at = np.array([[2.5, 2.5, 2.5]])
    assert probe_places.is_solid(probe_places.freed(at, np.pad(solid, 4, mode="edge")), solid)
