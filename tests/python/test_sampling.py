"""Random numbers of the renderer: spread evenly, and independent of how they are asked for."""

import numpy as np
import pytest

from limitray.sampling import Sampler, cone, cosine_hemisphere

PIXELS = np.arange(500, dtype=np.uint32)


@pytest.mark.parametrize("columns", [1, 2, 4, 8, 16])
def test_the_first_samples_of_a_pixel_fill_every_grid(columns):
    rows = 16 // columns
    for purpose in (0, 5):
        points = np.stack([Sampler(3, i).square(purpose, PIXELS) for i in range(16)])
        cells = np.floor(points[:, 0] * columns) * rows + np.floor(points[:, 1] * rows)
        np.testing.assert_array_equal(
            np.sort(cells, axis=0), np.arange(16)[:, np.newaxis] + 0 * cells
        )


def test_a_number_depends_on_seed_sample_purpose_and_pixel_alone():
    square = Sampler(1, 7).square(2, PIXELS)
    np.testing.assert_array_equal(Sampler(1, 7).square(2, PIXELS[100:200]), square[:, 100:200])
    others = [Sampler(2, 7).square(2, PIXELS), Sampler(1, 8).square(2, PIXELS),
              Sampler(1, 7).square(3, PIXELS), Sampler(1 + 2**40, 7).square(2, PIXELS)]  # fmt: skip
    for other in others:
        assert (other == square).mean() < 0.01


def test_pixels_and_purposes_are_independent():
    many = np.arange(1 << 16, dtype=np.uint32)
    rows = np.concatenate([Sampler(0, 0).square(purpose, many) for purpose in (0, 1, 2)])
    assert 0 <= rows.min() < rows.max() < 1
    np.testing.assert_allclose(rows.mean(axis=1), 0.5, atol=4 * 0.29 / 256)
    correlation = np.corrcoef(np.concatenate([rows, np.roll(rows, 1, axis=1)]))
    assert np.abs(correlation - np.eye(12)).max() < 5 / 256


def test_directions_have_the_densities_they_are_said_to_have():
    square = Sampler(0, 0).square(0, np.arange(1 << 16, dtype=np.uint32))
    directions = cosine_hemisphere(square)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=0), 1, atol=1e-6)
    np.testing.assert_allclose(directions.mean(axis=1), (0, 0, 2 / 3), atol=0.01)
    within = cone(square, 0.3)
    np.testing.assert_allclose(np.linalg.norm(within, axis=0), 1, atol=1e-6)
    assert within[2].min() >= 0.7
    np.testing.assert_allclose(within.mean(axis=1), (0, 0, 0.85), atol=0.01)
