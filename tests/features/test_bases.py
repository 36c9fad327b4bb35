"""Features of coordinates, against values worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from irl_gym.errors import InvalidFeatures
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.feature_maps import Unravel

MAPS = {
    "RadialBasis": RadialBasis.grid([0, 0], [1, 1], 2),
    "Fourier": Fourier([0, 0], [1, 1]),
    "Polynomial": Polynomial([0, 0], [1, 1]),
}
every_map = pytest.mark.parametrize("phi", MAPS.values(), ids=MAPS.keys())


def gaussians(centres, sigma, coordinates=None):
    return RadialBasis(np.array(centres, dtype=float), np.array(sigma) if np.ndim(sigma) else sigma, coordinates)


def first(observations):
    return np.asarray(observations)[:, :1]


def words(observations):
    return [["a"] for _ in observations]


# --- Gaussians ---


def test_radial_basis_is_1_in_its_centre():
    phi = gaussians([[0.3, -1.0], [5.0, 2.0]], [0.1, 2.0])
    np.testing.assert_array_equal(np.diag(phi(phi.centres)), [1, 1])


def test_radial_basis_falls_by_the_widths_of_the_coordinates():
    phi = gaussians([[0.0, 0.0]], [1.0, 2.0])
    found = phi(np.array([[1.0, 0.0], [0.0, 2.0], [2.0, 2.0]]))[:, 0]
    np.testing.assert_allclose(found, np.exp([-0.5, -0.5, -2.5]))


def test_radial_basis_has_one_width_for_all_when_it_is_a_number():
    np.testing.assert_array_equal(gaussians(np.zeros((3, 2)), 0.5).sigma, [0.5, 0.5])


def test_radial_basis_leaves_out_a_coordinate_of_infinite_width():
    phi = gaussians([[0.0, 0.0]], [1.0, np.inf])
    np.testing.assert_allclose(phi(np.array([[1.0, 7.0], [1.0, -300.0]]))[:, 0], np.exp(-0.5))


def test_radial_basis_is_exact_far_from_the_origin():
    assert gaussians([[1e9]], 1.0)(np.array([[1e9 + 1]]))[0, 0] == pytest.approx(np.exp(-0.5), rel=1e-12)


def test_radial_basis_grid_has_its_centres_from_low_to_high():
    assert RadialBasis.grid([0, -1], [2, 1], (3, 2)).centres.tolist() == [[x, y] for x in (0, 1, 2) for y in (-1, 1)]


@pytest.mark.parametrize("width", [1.0, 0.5])
def test_radial_basis_grid_has_sigma_in_units_of_the_spacing(width):
    np.testing.assert_allclose(RadialBasis.grid([0, -1], [2, 1], (3, 6), width=width).sigma, [width, 0.4 * width])


def test_radial_basis_grid_puts_a_lone_centre_in_the_middle():
    phi = RadialBasis.grid([0, 2], [4, 3], (1, 2))
    assert phi.centres.tolist() == [[2, 2], [2, 3]] and phi.sigma.tolist() == [4, 1]


def test_radial_basis_of_the_paper_sums_to_the_root_of_two_pi_inside():
    sigma = 1.7 / 19  # experiment 2: spacing and width
    phi = gaussians(-1.2 + (np.arange(26)[:, None] - 3) * sigma, sigma)
    inside = np.linspace(-1.2, 0.5, 1001)[:, None]
    np.testing.assert_allclose(phi(inside).sum(axis=1), np.sqrt(2 * np.pi), rtol=2e-3)


def test_radial_basis_grid_makes_the_gaussians_of_the_paper():
    sigma = 1.7 / 19
    phi = RadialBasis.grid([-1.2 - 3 * sigma], [0.5 + 3 * sigma], 26)
    np.testing.assert_allclose(phi.centres[:, 0], -1.2 + (np.arange(26) - 3) * sigma, atol=1e-12)
    np.testing.assert_allclose(phi.sigma, sigma)


def test_radial_basis_names_its_widths():
    assert "sigma 1, 0.25" in gaussians([[0, 0]], [1, 0.25]).scaling


@given(x=hnp.arrays(float, (5, 2), elements=st.floats(-1e6, 1e6)))
def test_radial_basis_stays_between_0_and_1(x):
    values = MAPS["RadialBasis"](x)
    assert values.min() >= 0 and values.max() <= 1


# --- Fourier ---


def test_fourier_is_cosines_of_scaled_coordinates():
    phi = Fourier([0, -1], [2, 1], 1)  # c = (0,0), (0,1), (1,0), (1,1)
    u = np.array([0.25, 0.75])
    expected = np.cos(np.pi * np.array([0, u[1], u[0], u.sum()]))
    np.testing.assert_allclose(phi(np.array([[0.5, 0.5]]))[0], expected, atol=1e-12)


@pytest.mark.parametrize(("order", "d", "K"), [(0, 1, 1), (3, 1, 4), (3, 2, 16), (1, 4, 16)])
def test_fourier_has_order_plus_1_to_the_power_of_d_features(order, d, K):
    assert Fourier([0] * d, [1] * d, order).n_features == K


def test_fourier_names_its_bounds():
    assert "[0, -1]..[2, 1]" in Fourier([0, -1], [2, 1]).scaling


# --- polynomials ---


def test_polynomial_is_monomials_of_scaled_coordinates():
    phi = Polynomial([0, -1], [2, 1], 2)
    x, y = 0.5, -0.25  # at (1.5, -0.25)
    assert phi.exponents.tolist() == [[0, 0], [0, 1], [1, 0], [0, 2], [1, 1], [2, 0]]
    np.testing.assert_allclose(phi(np.array([[1.5, -0.25]]))[0], [1, y, x, y * y, x * y, x * x])


@pytest.mark.parametrize(("degree", "d", "K"), [(0, 3, 1), (4, 1, 5), (2, 2, 6), (3, 3, 20)])
def test_polynomial_has_the_monomials_up_to_its_degree(degree, d, K):
    assert Polynomial([0] * d, [1] * d, degree).n_features == K


@given(x=hnp.arrays(float, (5, 2), elements=st.floats(0, 1)))
def test_polynomial_stays_between_minus_1_and_1_inside(x):
    assert np.abs(MAPS["Polynomial"](x)).max() <= 1 + 1e-12


# --- coordinates ---


def test_coordinates_are_made_of_observations():
    phi = gaussians([[1.0, 2.0]], 1.0, Unravel((3, 4)))
    np.testing.assert_allclose(phi(np.array([6, 5, 2]))[:, 0], np.exp([0, -0.5, -0.5]))


@every_map
def test_coordinates_of_images_are_flattened(phi):
    x = np.random.default_rng(0).random((3, 2, 1))
    np.testing.assert_array_equal(phi(x), phi(x.reshape(3, 2)))


@every_map
@pytest.mark.parametrize(
    ("observations", "message"),
    [
        (np.zeros((4, 3)), "have 3 coordinates: expected 2"),
        (np.arange(4), "have 1 coordinates: expected 2"),
        ({"a": np.zeros(3)}, "cannot be read as numbers"),
    ],
)
def test_observations_of_another_width_are_refused(phi, observations, message):
    with pytest.raises(InvalidFeatures, match=message):
        phi(observations)


@pytest.mark.parametrize(("coordinates", "message"), [(first, "have 1 coordinates: expected 2"), (words, "cannot be read")])
def test_coordinates_of_another_width_are_refused(coordinates, message):
    with pytest.raises(InvalidFeatures, match=message):
        gaussians([[0, 0]], 1.0, coordinates)(np.zeros((4, 2)))


# --- bad input ---


@pytest.mark.parametrize("centres", [[1.0, 2.0], np.zeros((0, 2)), np.zeros((2, 0)), [[np.nan, 0.0]], [[1.0], [2.0, 3.0]]])
def test_radial_basis_refuses_centres_that_are_no_table(centres, unchecked):
    with pytest.raises(InvalidFeatures, match="centres"):
        RadialBasis(centres, 1.0)


@pytest.mark.parametrize("sigma", [0.0, -1.0, np.nan, [1.0], [1.0, 0.0], [1.0, 1.0, 1.0], "wide"])
def test_radial_basis_refuses_widths_that_are_none(sigma, unchecked):
    with pytest.raises(InvalidFeatures, match="sigma"):
        RadialBasis([[0.0, 0.0]], sigma)


@pytest.mark.parametrize("counts", [0, (2, 0), -3])
def test_radial_basis_grid_refuses_no_centres(counts):
    with pytest.raises(InvalidFeatures, match="expected at least one centre"):
        RadialBasis.grid([0, 0], [1, 1], counts)


@pytest.mark.parametrize("width", [0.0, -1.0, np.nan, np.inf])
def test_radial_basis_grid_refuses_a_width_that_is_none(width):
    with pytest.raises(InvalidFeatures, match="width is"):
        RadialBasis.grid([0, 0], [1, 1], 3, width=width)


@pytest.mark.parametrize("counts", [(1, 2, 3), 2.5, "many", (2.5, 2)])
def test_radial_basis_grid_refuses_counts_that_are_none(counts, unchecked):
    with pytest.raises(InvalidFeatures, match="counts"):
        RadialBasis.grid([0, 0], [1, 1], counts)


BOUNDS = [([0, 0], [1]), ([0], [0]), ([1], [0]), ([], []), ([0], [np.inf]), ([np.nan], [1]), ([[0]], [[1]]), (["a"], [1])]


@pytest.mark.parametrize("make", [Fourier, Polynomial, lambda low, high: RadialBasis.grid(low, high, 2)])
@pytest.mark.parametrize(("low", "high"), BOUNDS)
def test_bounds_that_do_not_fit_are_refused(make, low, high, unchecked):
    with pytest.raises(InvalidFeatures, match=r"low|the bounds are"):
        make(low, high)


@pytest.mark.parametrize("make", [Fourier, Polynomial])
@pytest.mark.parametrize("order", [-1, 1.5, "two", None])
def test_an_order_that_is_none_is_refused(make, order, unchecked):
    with pytest.raises(InvalidFeatures, match="the order is"):
        make([0], [1], order)
