"""GI-free: the table of everything in Filters → TopoSeam. A menu entry is an entry here and a function."""

from __future__ import annotations

from toposeam_gimp.entries.animation import ANIMATION_ENTRIES
from toposeam_gimp.entries.motifs import MOTIF_ENTRIES
from toposeam_gimp.entries.seams import SEAM_ENTRIES
from toposeam_gimp.entries.textures import TEXTURE_ENTRIES

PROCEDURES = {
    entry.name: entry for entry in (*SEAM_ENTRIES, *TEXTURE_ENTRIES, *MOTIF_ENTRIES, *ANIMATION_ENTRIES)
}
