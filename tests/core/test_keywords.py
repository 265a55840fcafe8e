"""Keywords that a type checker and an editor know are the options there are."""

import dataclasses
import inspect
import re
from typing import get_type_hints

import pytest

import toposeam as ts
from toposeam.motif.generate import RecipeKeywords
from toposeam.motif.ink import SvgKeywords
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


def test_keywords_of_stitch_are_its_options_and_documented():
    """Each field has a comment that Sphinx takes for its documentation, on the lines above it."""
    options, methods = dataclasses.fields(ts.layers.StitchOptions), get_type_hints(SeamKeywords)
    assert not {option.name for option in options} & methods.keys()
    signature, own = (inspect.signature(one).parameters for one in (ts.stitch, ts.layers.StitchOptions))
    assert {name: signature[name] for name in own} == dict(own)
    assert set(signature) == {*own, "layers", "keywords"}
    assert set(own) == {option.name for option in options}
    assert ":class:`toposeam.layers.StitchOptions`" in ts.stitch.__doc__
    lines = inspect.getsource(ts.layers.StitchOptions).splitlines()
    for name in own:
        (number,) = (index for index, line in enumerate(lines) if line.startswith(f"    {name}: "))
        assert re.fullmatch(r"    #: \S.*\.", lines[number - 1]), name


def test_keywords_of_motifs_are_those_of_recipes():
    parameters = set(inspect.signature(ts.motif.random_recipe).parameters)
    assert set(RecipeKeywords.__annotations__) == parameters - {"size"}
