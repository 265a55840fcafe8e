"""Drawing of a motif as PDF for print: a spot colour for each ink, as curves.

Each ink is a transparency group in a `Separation` space of its own (PDF 1.7, 8.6.6.4), whose alternate colour
is that of the ink. Groups of transparent inks multiply with what lies below, which keeps every ink on its own
plate; those of opaque inks cover.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np

from toposeam.checks import check_kind
from toposeam.motif.ink.stroke_edges import fineness
from toposeam.motif.ink.svg import Bands, Drawable, InkedArea, SvgOptions, check_counts, inked_areas
from toposeam.motif.symmetry.tiling import lines_of_copies
from toposeam.vector.contours import MARGIN_PX, CurvePath

#: Points of PDF in a millimetre, and in an element where no width is given: 96 px per inch, as in SVG.
_POINTS_PER_MM, _POINTS_PER_PX = 72 / 25.4, 0.75


def draw_pdf(
    motif: Drawable, counts: tuple[float, float] = (1, 1), *, options: SvgOptions, metadata: bytes = b""
) -> bytes:
    """Return a motif, or a sheet of it, as a PDF document of one page.

    Parameters
    ----------
    motif : Motif or Arrangement
    counts : (rows, columns)
        Number of motifs on the page, whole or not.
    options : SvgOptions
    metadata : bytes
        An XMP packet, kept uncompressed.

    Raises
    ------
    OptionError
        For impossible counts.
    """
    check_kind("motif", motif, Drawable, "a Motif")
    check_counts(counts)
    height, width = motif.densities.shape[1:]
    copies, rows = lines_of_copies(motif.repeat, counts)
    laid = [row.after(copy) for row in rows for copy in copies]
    sheet = width * counts[1], height * counts[0]
    free = max(-options.frame, 0.0)
    places = [f"{free:.4f} {free:.4f} {sheet[0] - 2 * free:.4f} {sheet[1] - 2 * free:.4f} re W n"]
    places += [
        f"q {at.flip_x} 0 0 {at.flip_y} {at.x * width:.4f} {at.y * height:.4f} cm /C Do Q" for at in laid
    ]
    fine = fineness((height, width))
    scale = _POINTS_PER_PX if options.width_mm is None else options.width_mm / width * _POINTS_PER_MM
    page = width * counts[1] * scale, height * counts[0] * scale
    document = _Document()
    margin = MARGIN_PX / fine
    # Copies overlap by half an element on each side, so that no hairline shows between them.
    beyond = margin if len(laid) == 1 else 0.5
    box = f"[{-beyond} {-beyond} {width + beyond} {height + beyond}]"
    opaque = motif.inking == "opaque"
    states = [document.add(f"<< /BM /{'Normal' if opaque else 'Multiply'} /ca 1 >>")]
    colours, groups = [], []
    densities = motif.resampled((fine * height, fine * width))
    for layer, (density, ink, edge, name) in enumerate(
        zip(densities, motif.inks, motif.edges, motif.names, strict=True)
    ):
        bands = Bands(edge, motif.ends(layer), options.levels)
        faint, areas = inked_areas(density, motif.repeat, bands, fine)
        shade = " ".join(f"{value:.4f}" for value in ink)
        function = f"<< /FunctionType 2 /Domain [0 1] /C0 [1 1 1] /C1 [{shade}] /N 1 >>"
        colours.append(document.add(f"[/Separation {_name(name)} /DeviceRGB {function}]"))
        commands, covers = _painted(faint, areas, fine, (height, width), opaque)
        shown = " ".join(f"/A{index} << /ca {cover:.4f} >>" for index, cover in enumerate(covers))
        resources = f"/ColorSpace << /S {colours[-1]} 0 R >> /ExtGState << {shown} >>"
        cell = document.stream(
            commands, f"/Type /XObject /Subtype /Form /BBox {box} /Resources << {resources} >>"
        )
        whole = f"[0 0 {sheet[0]:.4f} {sheet[1]:.4f}]"
        groups.append(
            document.stream(
                [*places, *_frame(sheet, options.frame)],
                f"/Type /XObject /Subtype /Form /BBox {whole} /Group << /S /Transparency >> "
                f"/Resources << /ColorSpace << /S {colours[-1]} 0 R >> /XObject << /C {cell} 0 R >> >>",
            )
        )
    content = [f"{scale:.8f} 0 0 {-scale:.8f} 0 {page[1]:.4f} cm"]
    if not options.transparent:
        paper = " ".join(f"{value:.4f}" for value in motif.paper)
        content.append(f"{paper} rg 0 0 {width * counts[1]:.4f} {height * counts[0]:.4f} re f")
    content.append("/B gs")
    content += [f"/I{index} Do" for index in range(len(groups))]
    shown = " ".join(f"/I{index} {number} 0 R" for index, number in enumerate(groups))
    return document.finished(
        content,
        f"/MediaBox [0 0 {page[0]:.4f} {page[1]:.4f}] "
        f"/Resources << /XObject << {shown} >> /ExtGState << /B {states[0]} 0 R >> >>",
        metadata,
    )


def _frame(sheet: tuple[float, float], width: float) -> list[str]:
    """Return the commands that paint a frame of ink along the edge of a sheet, if it has a width."""
    if width <= 0:
        return []
    inner = f"{width:.4f} {width:.4f} {sheet[0] - 2 * width:.4f} {sheet[1] - 2 * width:.4f} re"
    return ["/S cs 1 scn", f"0 0 {sheet[0]:.4f} {sheet[1]:.4f} re {inner} f*"]


def _painted(
    faint: float, areas: Sequence[InkedArea], fine: int, size: tuple[int, int], opaque: bool
) -> tuple[list[str], list[float]]:
    """Return the commands that paint one ink on a cell, and the opacities they name."""
    covers: list[float] = []

    def tone(value: float, below: float) -> str:
        if not opaque:
            return f"{value:.4f} scn"
        covers.append(min(max(1.0 - (1.0 - value) / max(1.0 - below, 1e-6), 0.0), 1.0))
        return f"/A{len(covers) - 1} gs 1 scn"

    commands = ["/S cs"]
    if faint > 0:
        margin = MARGIN_PX / fine
        height, width = size[0] + 2 * margin, size[1] + 2 * margin
        commands += [tone(faint, 0.0), f"{-margin} {-margin} {width} {height} re f"]
    for area in areas:
        commands.append(tone(area.tone, area.below))
        commands += [_path(stroke, fine) for stroke in area.strokes if len(stroke.curves)]
    return commands, covers


def _path(stroke: CurvePath, fine: int) -> str:
    """Return the commands that fill a path of closed loops by the even-odd rule."""
    words = []
    for loop in np.split(stroke.curves / fine, stroke.starts[1:]):
        words.append("{:.3f} {:.3f} m".format(*loop[0, 0]))
        words += ["{:.3f} {:.3f} {:.3f} {:.3f} {:.3f} {:.3f} c".format(*curve[1:].ravel()) for curve in loop]
        words.append("h")
    return " ".join([*words, "f*"])


def _name(text: str) -> str:
    """Write a name of PDF: what is not a letter or a digit as its UTF-8 bytes."""
    return "/" + "".join(
        chr(byte) if chr(byte).isalnum() and byte < 128 else f"#{byte:02X}" for byte in text.encode()
    )


class _Document:
    """The objects of a PDF file, the first two kept for catalogue and page tree."""

    def __init__(self) -> None:
        self._objects: list[bytes] = [b"", b""]

    def add(self, text: str) -> int:
        """Add an object; return its number."""
        self._objects.append(text.encode("ascii"))
        return len(self._objects)

    def stream(self, lines: Sequence[str], entries: str) -> int:
        """Add a compressed stream; return its number."""
        data = zlib.compress("\n".join(lines).encode("ascii"), 9)
        head = f"<< {entries} /Filter /FlateDecode /Length {len(data)} >>\nstream\n"
        self._objects.append(head.encode("ascii") + data + b"\nendstream")
        return len(self._objects)

    def finished(self, content: Sequence[str], page: str, metadata: bytes) -> bytes:
        """Return the file with one page."""
        shown = self.stream(content, "")
        about = ""
        if metadata:
            head = f"<< /Type /Metadata /Subtype /XML /Length {len(metadata)} >>\nstream\n".encode("ascii")
            self._objects.append(head + metadata + b"\nendstream")
            about = f" /Metadata {len(self._objects)} 0 R"
        leaf = self.add(f"<< /Type /Page /Parent 2 0 R {page} /Contents {shown} 0 R >>")
        self._objects[0] = f"<< /Type /Catalog /Pages 2 0 R{about} >>".encode("ascii")
        self._objects[1] = f"<< /Type /Pages /Kids [{leaf} 0 R] /Count 1 >>".encode("ascii")
        parts, places = [b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n"], []
        for number, body in enumerate(self._objects, 1):
            places.append(sum(map(len, parts)))
            parts.append(b"%d 0 obj\n%b\nendobj\n" % (number, body))
        start = sum(map(len, parts))
        table = "".join(f"{place:010d} 00000 n \n" for place in places)
        count = len(places) + 1
        parts.append(f"xref\n0 {count}\n0000000000 65535 f \n{table}".encode("ascii"))
        parts.append(f"trailer << /Size {count} /Root 1 0 R >>\nstartxref\n{start}\n%%EOF\n".encode("ascii"))
        return b"".join(parts)
