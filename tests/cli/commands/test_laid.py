"""Pictures are laid by the rule that is said, or refused."""

import numpy as np
import pytest

from toposeam_cli.media.pictures.picture import Picture, write_picture


@pytest.mark.parametrize("rule", ["p2", "pmm", "cm", "p4m", "p6"])
def test_a_picture_is_not_repeated_by_an_unsuitable_group(folder, toposeam, rule):
    write_picture("any.png", Picture(pixels=np.arange(48, dtype=np.uint8).reshape(6, 8)))
    toposeam("repeat", "any.png", "2x2", "-o", "o.png", "--repeat", rule).fails(f"not made for {rule}")
    toposeam("mockup", "any.png", "--on", "tie", "-o", "o.png", "--repeat", rule).fails("not made for")
    assert toposeam("repeat", "any.png", "2x2", "-o", "o.png", "--repeat", "p1").code == 0


def test_a_motif_is_laid_by_the_group_it_was_made_for(folder, toposeam):
    toposeam("motif", "-o", "p4m.png", "--size", "32", "--iterations", "2", "--seed", "1", "--repeat", "p4m")
    assert toposeam("repeat", "p4m.png", "2x2", "-o", "o.png", "--repeat", "p4m").code == 0
    toposeam("repeat", "p4m.png", "2x2", "-o", "q.png", "--repeat", "p4").fails("not made for p4")
