"""What a pattern book consists of."""

import numpy as np

from toposeam.motif.book import book_recipe


def test_patterns_of_a_book_are_drawn_from_its_ranges():
    theme = np.zeros((24, 24))
    theme[6:18, 6:18] = 1
    every = [book_recipe(theme, 7, number, 32) for number in range(1, 321)]
    recipes = [recipe for recipe in every if recipe.base_law == "brightness"]  # the theme shows
    hidden = [recipe for recipe in every if recipe.base_law == "contrast"]
    assert 0.4 < len(recipes) / len(every) < 0.6
    assert len({recipe.layers[0].style for recipe in hidden}) == 15
    assert len({recipe.repeat for recipe in hidden}) > 15
    radii = np.array([recipe.filter_radius for recipe in recipes])
    masses = np.array([recipe.layers[0].mass for recipe in recipes])
    thick = radii > 1.35
    # Thick strokes: 1.5 to 3 elements and up to 36 % ink; the others 0.6 to 1.2, and up to 22 %.
    assert radii[thick].min() >= 1.5
    assert radii[thick].max() <= 3.0
    assert np.ptp(radii[thick]) > 1.2
    assert radii[~thick].min() >= 0.6
    assert radii[~thick].max() <= 1.2
    assert 0.3 < thick.mean() < 0.7
    assert 0.2 <= masses[thick].min() < masses[thick].max() <= 0.36
    assert 0.08 <= masses[~thick].min() < masses[~thick].max() <= 0.22
    assert 2**30 < max(recipe.seed for recipe in recipes) < 2**31  # of 32 bits, as other programs have them
    assert {recipe.layers[0].penalty for recipe in recipes} == {1, 2, 3}
    assert {recipe.iterations for recipe in recipes} == set(range(20, 51))
    assert book_recipe(theme, 7, 3, 32) == book_recipe(theme, 7, 3, 32) != book_recipe(theme, 8, 3, 32)
