"""Each row of the page of parameter studies does what its caption says, measured."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))
from pattern_cases import FIXED, STUDIES, inked


@pytest.mark.slow
@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.words.split("{")[0] + study.claim)
def test_a_row_does_what_its_caption_says(study):
    """From the first to the last by a fifth at least, and with the order of the row: a rank correlation of
    0.8 or more.
    """
    motifs = study.motifs()
    found = np.array([study.measured(motif) for motif in motifs])
    ranks = np.argsort(np.argsort(found if study.grows else -found, kind="stable"), kind="stable")
    assert np.corrcoef(ranks, np.arange(len(found)))[0, 1] >= 0.8
    low, high = (found[0], found[-1]) if study.grows else (found[-1], found[0])
    assert high >= 1.2 * low
    if study.measured is inked:
        masses = [FIXED["mass"] if "mass" not in options else options["mass"] for options in study.options]
        np.testing.assert_allclose(found, masses, atol=0.02)
