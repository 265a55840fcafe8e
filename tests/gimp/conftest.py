"""A real GIMP 3 without a display, started once; see gimp3.sh for where it comes from."""

import sys

import pytest
from running import CHECKOUT, Gimp, find_gimp

collect_ignore = ["inside_gimp.py"]  # GIMP's Python runs it


@pytest.fixture(scope="session")
def real_gimp():
    """Where the console GIMP is."""
    return find_gimp()


@pytest.fixture(scope="session")
def gimp(real_gimp, tmp_path_factory):
    running = Gimp(tmp_path_factory.mktemp("gimp"))
    yield running
    running.close()


@pytest.fixture
def engine(gimp):
    """Replace the engine for one test: `engine(script)`; without a script it is gone."""

    def change(script=None):
        if script is None:
            gimp.engine.unlink()
        else:
            gimp.set_engine(script.replace("PYTHON", f'"{sys.executable}"'))

    yield change
    gimp.set_engine(f'exec "{sys.executable}" "$@"')


@pytest.fixture
def image(gimp):
    """`image(files, **options)` loads pictures as layers; they are closed after the test."""
    opened = []

    def load(files, **options):
        loaded = gimp.load(files=[str(file) for file in files], **options)
        opened.append(loaded["image"])
        return loaded

    yield load
    for number in opened:
        gimp.delete(image=number)


@pytest.fixture
def samples():
    return CHECKOUT / "samples"


@pytest.fixture
def still_life(samples):
    return [samples / "still_life_left.png", samples / "still_life_right.png"]
