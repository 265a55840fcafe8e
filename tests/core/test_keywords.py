"""Keywords that a type checker and an editor know are the options there are."""

import dataclasses
import inspect
import re
from typing import get_type_hints

import pytest

import toposeam as ts
from toposeam.layers.composite.options import StitchKeywords
from toposeam.motif.generate import RecipeKeywords
from toposeam.motif.ink.svg import SvgKeywords
from toposeam.path.gather import PathKeywords
from toposeam.seam.keywords import SeamKeywords
from toposeam.texture.placement import LayKeywords
from toposeam.volume.heat import SurfaceKeywords


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


def test_keywords_of_stitch_are_its_options_by_name_and_type():
    options, methods = get_type_hints(ts.layers.StitchOptions), get_type_hints(SeamKeywords)
    assert not options.keys() & methods.keys()
    assert get_type_hints(StitchKeywords) == options | methods
    said = re.compile(r"^    (\w+(?:, \**\w+)*)(?: :|$)", re.MULTILINE).findall(ts.stitch.__doc__)
    assert set(options) <= set(", ".join(said).split(", "))
    assert set(options) < set(inspect.signature(ts.stitch).parameters)


def test_keywords_of_motifs_are_those_of_recipes():
    parameters = set(inspect.signature(ts.motif.random_recipe).parameters)
    assert set(RecipeKeywords.__annotations__) == parameters - {"size"}
