"""How surfaces reflect: energy, and sampling that agrees with evaluation."""

import numpy as np
import pytest

from limitray.bsdf import Bsdf
from limitray.hits import Surface
from limitray.sampling import Sampler

SIDE = 256
COUNT = SIDE * SIDE
CENTRES = (np.arange(SIDE, dtype=np.float32) + 0.5) / SIDE
SQUARE = np.stack([a.ravel() for a in np.meshgrid(CENTRES, CENTRES)])
OTHER = Sampler(0, 0).square(0, np.arange(COUNT, dtype=np.uint32))
ROUGHNESSES = (0.05, 0.2, 0.5, 1.0)
COSINES = (0.1, 0.5, 0.95)


def bsdf(color, roughness, metallic=0.0, ior=1.5, cosine=0.5, normal=(0.36, 0.48, 0.8)):
    """The same surface COUNT times, seen under one angle; and its normal."""
    ones = np.ones(COUNT, np.float32)
    normal = np.array(normal)
    side = np.cross(normal, (0.0, 1, 0))
    viewer = cosine * normal + np.sqrt(1 - cosine**2) * side / np.linalg.norm(side)

    def spread(vector):
        return np.repeat(np.array(vector, np.float32)[:, np.newaxis], COUNT, axis=1)

    reflectance = ((ior - 1) / (ior + 1)) ** 2
    surface = Surface(spread(normal), spread(color), roughness * ones, metallic * ones,
                      reflectance * ones)  # fmt: skip
    return Bsdf(surface, spread(-viewer)), spread(normal), spread(viewer)


def uniform_hemisphere(normals):
    """Unit directions above the surface, with density 1 / 2 pi."""
    z, angle = 2 * SQUARE[0] - 1, 2 * np.pi * SQUARE[1]
    r = np.sqrt(1 - z * z)
    directions = np.stack([r * np.cos(angle), r * np.sin(angle), z])
    return directions * np.sign((directions * normals).sum(axis=0))


def albedo(reflection):
    """Mean reflected light (3,) under a uniform sky of 1."""
    _, weights, density = reflection.sample(SQUARE, OTHER[0])
    return np.where(density > 0, weights, 0).mean(axis=1)


def test_plain_diffuse_reflects_its_colour_under_every_angle():
    for cosine in COSINES:
        color = (0.2, 0.5, 1.0)
        np.testing.assert_allclose(albedo(bsdf(color, 0, cosine=cosine)[0]), color, rtol=1e-5)


@pytest.mark.parametrize("metallic", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("roughness", ROUGHNESSES)
def test_white_stays_white(roughness, metallic):
    """The furnace test: nothing is lost between facets, or between layer and base."""
    for cosine in COSINES:
        reflection = bsdf((1, 1, 1), roughness, metallic, cosine=cosine)[0]
        np.testing.assert_allclose(albedo(reflection), 1, atol=0.005)


@pytest.mark.parametrize("roughness", ROUGHNESSES)
def test_colours_never_gain_energy(roughness):
    for metallic in (0.0, 1.0):
        reflected = albedo(bsdf((0.9, 0.5, 0.1), roughness, metallic)[0])
        assert (reflected < (0.93, 0.62, 0.35)).all()
        assert (reflected > (0.8, 0.3, 0.05)).all()


@pytest.mark.parametrize("metallic", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [0.0, 0.3, 0.6, 1.0])
def test_sampling_agrees_with_evaluation(roughness, metallic):
    """Two estimates of the albedo, and the density's integral."""
    reflection, normals, _ = bsdf((0.8, 0.4, 0.2), roughness, metallic)
    reflected, density = reflection.evaluate(uniform_hemisphere(normals))
    np.testing.assert_allclose(2 * np.pi * reflected.mean(axis=1), albedo(reflection), rtol=0.04)
    above = (reflection.sample(SQUARE, OTHER[0])[2] > 0).mean()
    np.testing.assert_allclose(2 * np.pi * density.mean(), above, rtol=0.04)


def test_drawn_densities_are_the_evaluated_ones():
    reflection, _, _ = bsdf((0.8, 0.4, 0.2), 0.3)
    directions, weights, density = reflection.sample(SQUARE, OTHER[0])
    reflected, again = reflection.evaluate(directions)
    np.testing.assert_allclose(again, density, rtol=2e-2, atol=1e-4)
    np.testing.assert_allclose(reflected, weights * density, rtol=5e-2, atol=1e-3)


def textbook_ggx(normal, viewer, light, alpha, color):
    """Single scattering of a metal in double, straight from Heitz 2014 and Schlick 1994."""
    half = (viewer + light) / np.linalg.norm(viewer + light)
    n_h, n_v, n_l = normal @ half, normal @ viewer, normal @ light
    density = alpha**2 / (np.pi * (n_h**2 * (alpha**2 - 1) + 1) ** 2)

    def masked(c):
        return (np.sqrt(1 + alpha**2 * (1 - c**2) / c**2) - 1) / 2

    masking = 1 / (1 + masked(n_v) + masked(n_l))
    fresnel = color + (1 - color) * (1 - half @ light) ** 5
    return fresnel * density * masking / (4 * n_v * n_l) * n_l


def test_metals_follow_the_formula():
    """Up to the factor for multiple scattering, which depends on the viewer alone."""
    color, roughness = np.array((0.9, 0.6, 0.3)), 0.4
    reflection, normals, viewers = bsdf(color, roughness, 1.0)
    lights = uniform_hemisphere(normals)
    found = reflection.evaluate(lights)[0].astype(float)
    rows = range(0, 400)
    expected = np.stack(
        [
            textbook_ggx(normals[:, i].astype(float), viewers[:, i].astype(float),
                         lights[:, i].astype(float), roughness**2, color) for i in rows
        ],
        axis=1,
    )  # fmt: skip
    factor = found[:, : len(rows)] / expected
    assert factor.min() >= 1
    np.testing.assert_allclose(
        factor, np.median(factor, axis=1, keepdims=True) + 0 * factor, rtol=1e-3
    )


def test_nothing_is_reflected_below_the_surface():
    for roughness in (0.0, 0.3):
        reflection, normals, _ = bsdf((1, 1, 1), roughness)
        reflected, density = reflection.evaluate(-uniform_hemisphere(normals))
        assert not reflected.any()
        assert not density.any()
