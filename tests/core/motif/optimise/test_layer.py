"""One colour layer: derivatives, bounds, monotone descent, base images, coarse plates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.motif.optimise import layer, optimise_layer, plan, problem_at, tile_size, to_tile
from toposeam.motif.optimise.layer import refine_temperature
from toposeam.motif.recipe import pack_base, unpack_base
from toposeam.motif.symmetry import symmetry
from toposeam.motif.symmetry.mirrors import mirrors

EXACT = {"tolerance": 1e-12, "max_iterations": 300}


def _recipe(size=48, **options):
    return ts.motif.random_recipe(size, layers=1, **options)


@pytest.mark.parametrize("repeat", ["none", "translate", "rotate", "p6m", "p3"])
@pytest.mark.parametrize("penalty", [1.0, 1.5, 2.0, 3.0])
def test_sensitivities_are_the_derivatives_of_the_compliance(repeat, penalty):
    base = np.linspace(0, 1, 400).reshape(20, 20)
    recipe = _recipe(16, repeat=repeat, base=base, penalty=penalty)
    problem = problem_at(recipe.layers[0], recipe, recipe.size)
    density = 0.2 + 0.7 * np.random.default_rng(0).random(recipe.size)

    def state(values):
        return problem.plate.solve(problem.conductivity(values, penalty), **EXACT)

    slope = problem.sensitivity(density, penalty, state(density).energy)
    for place in [(0, 0), (7, 15), (15, 3), (8, 8)]:
        up, down = density.copy(), density.copy()
        up[place] += 1e-5
        down[place] -= 1e-5
        expected = (state(up).compliance - state(down).compliance) / 2e-5
        # Differences of compliances known to twelve digits.
        assert slope[place] == pytest.approx(expected, rel=1e-4, abs=1e-6 * np.abs(slope).max())


@pytest.mark.medium
@pytest.mark.parametrize("repeat", ["none", "translate", "rotate", "p4m", "p6"])
def test_compliance_falls_after_the_first_iterations(repeat):
    recipe = _recipe(64, repeat=repeat, coarse=False, filter_radius=0, penalty=3.0)
    _, steps = optimise_layer(recipe.of_layer(0))
    compliance = np.array([step.compliance for step in steps])
    # The compliance of a state solved to 1e-3 is known to about 1e-6. What rows at mirrors must hold is what
    # those beyond them hold, which changes: that may cost a little.
    slack = 2e-3 if mirrors(repeat, (64, 64)).any else 1e-5
    assert (np.diff(compliance[5:]) < slack * compliance[5:-1]).all()
    assert compliance[-1] < 0.4 * compliance[0]


@pytest.mark.medium
@pytest.mark.parametrize("repeat", ["translate", "cmm"])
def test_designs_are_as_good_as_with_exact_temperatures(repeat, monkeypatch):
    recipe = _recipe(96, repeat=repeat, seed=5, penalty=3.0)
    at_size = problem_at(recipe.layers[0], recipe, recipe.size)
    values, effort = [], []
    for tolerance, energy in ((layer.TOLERANCE, layer.ENERGY), (1e-8, 0.0)):
        monkeypatch.setattr(layer, "TOLERANCE", tolerance)
        monkeypatch.setattr(layer, "ENERGY", energy)
        density, steps = optimise_layer(recipe.of_layer(0))
        k = at_size.conductivity(density.astype(float), recipe.layers[0].penalty)
        values.append(at_size.plate.solve(k, **EXACT).compliance)
        effort.append(sum(step.solver for step in steps))
    assert values[0] == pytest.approx(values[1], rel=2e-3)
    assert effort[0] < 0.35 * effort[1]


def test_layers_share_what_the_base_image_makes_of_a_plate():
    recipe = ts.motif.random_recipe(32, layers=2, repeat="p4", base=np.linspace(0, 1, 400).reshape(20, 20))
    first, second = (problem_at(layer, recipe, (32, 32)).nominal for layer in recipe.layers)
    assert first is second
    with pytest.raises(ValueError, match="read-only"):
        first[0, 0] = 1.0


@pytest.mark.parametrize("mass", [0.05, 0.3, 0.7])
def test_the_mass_is_what_was_allowed(mass):
    recipe = _recipe(64, repeat="translate", mass=mass)
    density, steps = optimise_layer(recipe.of_layer(0))
    assert density.mean() == pytest.approx(mass, abs=1e-3)
    assert all(step.mass == pytest.approx(mass, abs=1e-3) for step in steps)


def test_penalty_makes_strokes_distinct_and_wash_blurred():
    def gray(penalty):
        density = ts.generate_motif(_recipe(64, penalty=penalty, mass=0.3, filter_radius=0)).densities
        return np.mean((density > 0.1) & (density < 0.9))

    assert gray(3.0) < 0.6 * gray(1.0)


def test_iterations_and_move_limit_are_controls():
    few, slow, many = (
        ts.generate_motif(_recipe(48, penalty=3.0, **o)) for o in ({"iterations": 3}, {"move": 0.02}, {})
    )
    assert few.densities.std() < many.densities.std()
    assert slow.densities.std() < many.densities.std()
    assert len(few.history[0]) == 3


def test_strokes_keep_to_the_bright_parts_of_a_base_image():
    base = np.zeros((32, 32))
    base[:, :16] = 1.0
    heavy = ts.generate_motif(_recipe(48, base=base, base_strength=1.0, ambient=0.9)).densities[0]
    light = ts.generate_motif(_recipe(48, base=base, base_strength=0.3, ambient=0.9)).densities[0]
    inverse = ts.generate_motif(_recipe(48, base=base, base_strength=-1.0, ambient=0.9)).densities[0]

    def difference(density):
        return density[:, :24].mean() - density[:, 24:].mean()

    assert difference(heavy) > difference(light) > 0 > difference(inverse)


def test_a_base_image_survives_packing_within_a_level():
    image = np.random.default_rng(0).random((40, 30))
    assert np.abs(unpack_base(pack_base(image)) - image).max() <= 0.5 / 255 + 1e-6
    assert unpack_base(pack_base(np.zeros((1000, 500, 4), np.uint8))).shape == (256, 128)
    assert unpack_base(pack_base(np.zeros((8, 8, 4), np.uint8))).min() == 1.0  # transparent is paper


def test_coarse_plates_do_most_iterations():
    recipe = _recipe(192, filter_radius=1.5)
    assert plan(recipe) == [((48, 48), 27), ((96, 96), 8), ((192, 192), 5)]
    assert plan(replace(recipe, filter_radius=0.5)) == [
        ((192, 192), 40)
    ]  # strokes too fine for coarser plates
    assert sum(count for _, count in plan(replace(recipe, iterations=7))) == 7


@pytest.mark.slow
@pytest.mark.parametrize("repeat", ["none", "translate"])
def test_coarse_plates_reach_the_compliance_of_full_ones(repeat):
    recipe = _recipe(512, repeat=repeat, seed=2)
    at_size = problem_at(recipe.layers[0], recipe, recipe.size)
    values = []
    for one in (recipe, replace(recipe, coarse=False)):
        density, steps = optimise_layer(one.of_layer(0))
        assert len(steps) == 40
        k = at_size.conductivity(density.astype(float), recipe.layers[0].penalty)
        values.append(at_size.plate.solve(k, tolerance=1e-6, max_iterations=300).compliance)
    assert values[0] <= 1.01 * values[1]


def test_more_sources_and_sinks_make_finer_images():
    """The more there are, the finer the image (4.2): its spectrum moves to shorter waves."""

    def wavenumber(count):
        motif = ts.generate_motif(
            _recipe(96, repeat="translate", sources=count, sinks=count, ambient=0.0, mass=0.2, penalty=3.0)
        )
        power = np.abs(np.fft.fft2(motif.densities[0] - motif.densities[0].mean())) ** 2
        frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(96), np.fft.fftfreq(96)))
        return (power * frequency).sum() / power.sum()

    assert wavenumber(16) > 1.3 * wavenumber(2)


def test_strokes_widen_as_sink_and_source_come_closer():
    """4.2: the same mass spread along a shorter way."""

    def width(distance):
        motif = ts.generate_motif(
            _recipe(
                96, sources=[(0.15, 0.5)], sinks=[(0.15 + distance, 0.5)], ambient=0.0, mass=0.15, penalty=3.0
            )
        )
        density = motif.densities[0]
        return density[:, round(96 * (0.15 + distance / 2))].sum()

    assert width(0.2) > 1.5 * width(0.6)


def test_the_thesis_s_law_conducts_in_proportion_to_brightness():
    from toposeam.motif.optimise import VOID, nominal_conductivity

    brightness = np.array([[0.0, 0.25], [0.5, 1.0]])
    np.testing.assert_allclose(
        nominal_conductivity(brightness, 1.0, (2, 2), "brightness"), [[VOID, 0.25], [0.5, 1.0]]
    )
    np.testing.assert_allclose(
        nominal_conductivity(brightness, -0.5, (2, 2), "brightness"), [[1, 0.875], [0.75, 0.5 + 0.5 * VOID]]
    )
    made = ts.motif.random_recipe(16, base=brightness, base_law="brightness")
    assert made.base_law == "brightness"
    with pytest.raises(ts.OptionError, match="base_law"):
        ts.motif.random_recipe(16, base=brightness, base_law="thesis")


def test_a_finer_plate_starts_from_interpolated_temperatures():
    y, x = np.mgrid[:4, :6].astype(float)
    fine_y, fine_x = np.mgrid[:7, :11] / 2
    np.testing.assert_array_equal(refine_temperature(3 * x + 5 * y, (6, 10)), 3 * fine_x + 5 * fine_y)


@pytest.mark.parametrize(("radius", "plates"), [(2.5, 2), (2.49, 1)])
def test_coarser_plates_are_used_from_a_filter_of_2_5_elements(radius, plates):
    recipe = replace(ts.motif.random_recipe(100, layers=1, seed=1), filter_radius=radius)
    assert len(plan(recipe)) == plates


def in_cells(side):
    """Where the nodes of a hexagonal lattice lie, in cells, and the shifts to all copies near them."""
    v, u = np.mgrid[:side, :side] / side
    first, second = np.array([1.0, 0.0]), np.array([-0.5, np.sqrt(0.75)])
    shifts = [i * first + j * second for i in range(-2, 3) for j in range(-2, 3)]
    return u[..., np.newaxis] * first + v[..., np.newaxis] * second, shifts


@pytest.mark.parametrize("repeat", ["p3", "p3m1", "p6m"])
def test_hexagonal_sources_and_sinks_are_discs_on_paper(repeat):
    side = 100
    sources, sinks = [(0.31, 0.87, 0.5), (0.62, 0.4, 2.0)], [(0.0, 0.0, 0.7)]
    recipe = _recipe(side, repeat=repeat, sources=sources, sinks=sinks, ambient=0.25)
    plate = problem_at(recipe.layers[0], recipe, (side, side)).plate
    place, shifts = in_cells(side)

    def discs(points):
        total = np.zeros((side, side))
        for x, y, strength in points:
            at = np.array([x - y / 2, y * np.sqrt(0.75)])
            away = np.min([np.linalg.norm(place - at - shift, axis=-1) for shift in shifts], axis=0)
            disc = np.clip(1.2 + 0.5 - away * side, 0, 1)  # a radius of 0.012 cells, and edges of one element
            total += strength * disc / disc.sum()
        return symmetry(repeat, (side, side)).mean(total / sum(strength for *_, strength in points))

    np.testing.assert_allclose(plate.heat, 0.75 * discs(sources) + 0.25 / side**2, atol=1e-12)
    np.testing.assert_allclose(plate.convection, 4 * discs(sinks), atol=1e-12)


@pytest.mark.parametrize("shape", [(7, 5), (3, 8)])
def test_hexagonal_base_images_stand_upright_on_lattice_points(shape):
    side, (rows, columns) = 25, shape
    y, x = np.mgrid[:rows, :columns]
    image = 0.1 + 0.8 * np.sin(1 + x / 3 + y**2 / 17) ** 2
    recipe = _recipe(side, repeat="p3", base=image, base_law="brightness", base_strength=1.0)
    nominal = problem_at(recipe.layers[0], recipe, (side, side)).nominal
    place, shifts = in_cells(side)
    away = np.stack([place + shift for shift in shifts])
    distance = np.linalg.norm(away, axis=-1)
    nearest = np.take_along_axis(away, distance.argmin(axis=0)[np.newaxis, ..., np.newaxis], axis=0)[0]
    where = nearest * max(shape) + [columns / 2, rows / 2]
    shown = ndimage.map_coordinates(image, [where[..., 1], where[..., 0]], order=1, mode="nearest")
    mean = symmetry("p3", (side, side)).mean

    def at_triangles(nodes):
        right, below, opposite = (
            np.roll(nodes, -1, 1),
            np.roll(nodes, -1, 0),
            np.roll(nodes, (-1, -1), (0, 1)),
        )
        return np.stack([(nodes + right + opposite) / 3, (nodes + below + opposite) / 3])

    midway = np.sort(distance, axis=0)[1] - distance.min(axis=0) < 1e-9  # between two lattice points
    clear = at_triangles(mean(midway.astype(float))) == 0
    assert clear.mean() > 0.7
    np.testing.assert_allclose(nominal[clear], at_triangles(mean(shown))[clear], atol=0.01)


def test_nodes_are_pixels_of_a_tile_twice_as_large():
    side = 9
    lattice = symmetry("p31m", (side, side)).mean(0.1 + 0.8 * np.random.default_rng(0).random((side, side)))
    printed = to_tile(lattice, "p31m", (2 * side, 2 * side))
    v, u = np.mgrid[: 2 * side, :side]
    np.testing.assert_allclose(printed[v, (2 * u - v) % (2 * side)], lattice[v % side, u], atol=1e-6)
    assert tile_size(100) == (173, 100)


def test_tiles_are_the_wave_that_the_lattice_has():
    """Three waves at 120° on each other, which turn into each other."""
    side = 24
    place, _ = in_cells(side)

    def wave(x, y):
        # Of the lattice's own length, across lattice rows.
        phases = [
            4 * np.pi / np.sqrt(3) * (x * np.sin(a) + y * np.cos(a)) for a in np.pi * np.arange(3) * 2 / 3
        ]
        return 0.4 + 0.1 * sum(np.cos(phase) for phase in phases)

    for size in ((83, 48), (70, 90)):
        # A node lies a quarter of an element from the corner of the tile.
        y, x = np.ogrid[: size[0], : size[1]]
        x = (x + 0.5) / size[1] - 0.25 / side
        y = ((y + 0.5) / size[0] - 0.25 / side) * np.sqrt(3)
        printed = to_tile(wave(place[..., 0], place[..., 1]), "p6m", size)
        np.testing.assert_allclose(printed, wave(x, y), atol=2e-3)


def test_small_tiles_average_what_a_pixel_covers():
    noise = symmetry("p3", (96, 96)).mean(np.random.default_rng(0).random((96, 96)))
    fine, small = (to_tile(noise, "p3", (rows, rows * 4 // 7)) for rows in (168, 28))
    assert small.mean() == pytest.approx(noise.mean(), abs=5e-3)
    assert small.std() < 0.3 * fine.std()


def test_a_finer_lattice_goes_through_the_nodes():
    recipe = _recipe(16, repeat="p6")
    problem = problem_at(recipe.layers[0], recipe, (16, 16))
    v, u = np.mgrid[:16, :16] / 16

    def wave(v, u):
        return 0.5 + 0.2 * np.cos(2 * np.pi * u) + 0.1 * np.sin(2 * np.pi * (u - v))

    fine_v, fine_u = np.mgrid[:32, :32] / 32
    fine = problem.refine(wave(v, u), (32, 32))
    np.testing.assert_allclose(fine, wave(fine_v, fine_u), atol=1e-3)
    np.testing.assert_allclose(fine[::2, ::2], wave(v, u), atol=1e-9)
