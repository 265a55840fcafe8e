"""Keywords that a type checker and an editor know are the options there are."""

import dataclasses
import inspect

import pytest

import toposeam as ts
from toposeam.motif.generate import RecipeKeywords
from toposeam.motif.ink.svg import SvgKeywords
from toposeam.path.gather import PathKeywords
from toposeam.seam.keywords import SeamKeywords
from toposeam.texture.placement.options import LayKeywords
from toposeam.volume.heat.method import SurfaceKeywords


@pytest.mark.parametrize(
    ("keywords", "options"),
    [
        (SeamKeywords, [ts.seam.HeatOptions, ts.seam.ThesisOptions]),
        (LayKeywords, [ts.texture.LayOptions]),
        (SurfaceKeywords, [ts.volume.SurfaceOptions]),
        (PathKeywords, [ts.path.PathOptions]),
        (SvgKeywords, [ts.motif.SvgOptions]),
    ],
)
def test_keywords_are_fields_of_options(keywords, options):
    fields = {field.name for kind in options for field in dataclasses.fields(kind)}
    assert set(keywords.__annotations__) == fields


def test_keywords_of_motifs_are_those_of_recipes():
    parameters = set(inspect.signature(ts.motif.random_recipe).parameters)
    assert set(RecipeKeywords.__annotations__) == parameters - {"size"}
