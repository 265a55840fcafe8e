"""What the tests beside this have in common."""

import numpy as np
from hypothesis import strategies as st

from toposeam.vector.polyline import Polyline
from toposeam.vector.svg import read_svg

# As GIMP 3.0 exports a path: a DOCTYPE, the size in inches at the picture's 300 dpi, two decimals, lines as
# curves, the name as id.
GIMP_3_0 = """<?xml version="1.0" encoding="UTF-8" standalone="no"?>
<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 20010904//EN"
              "http://www.w3.org/TR/2001/REC-SVG-20010904/DTD/svg10.dtd">

<svg xmlns="http://www.w3.org/2000/svg"
     width="2.66667in" height="2in"
     viewBox="0 0 800 600">
  <path id="seam 1"
        fill="none" stroke="black" stroke-width="1"
        d="M 410.00,0.00
           C 410.00,0.00 410.00,120.00 410.00,120.00
             410.00,120.00 396.25,120.00 396.25,120.00
             396.25,120.00 396.25,600.00 396.25,600.00" />
  <path id="seam 2" fill="none" stroke="black" stroke-width="1" d="M 5.00,5.00" />
</svg>
"""


def one(document, **options):
    (line,) = read_svg(document, **options).polylines
    return line


def document(inner, head='width="100" height="50" viewBox="0 0 100 50"'):
    return f'<svg xmlns="http://www.w3.org/2000/svg" {head}>{inner}</svg>'


def path(data):
    return document(f'<path d="{data}"/>')


numbers = st.one_of(
    st.integers(-10000, 10000).map(float),
    st.floats(-1e9, 1e9),
    st.floats(allow_nan=False, allow_infinity=False, width=32),
)


lines = st.builds(
    Polyline,
    st.lists(st.tuples(numbers, numbers), min_size=2, max_size=6, unique=True).filter(
        lambda points: np.ptp(points, axis=0).any()
    ),
    st.booleans(),
)
