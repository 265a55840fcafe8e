"""What the documents say is what the code does: tables of numbers are made again and compared."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parents[1]


@pytest.mark.slow
def test_the_gallery_has_the_numbers_of_today(tmp_path):
    """``make figures``, into another folder."""
    pytest.importorskip("matplotlib")
    script = (
        "import sys; from pathlib import Path; import make_figures as made\n"
        "made.FIGURES, made.GALLERY = Path(sys.argv[1]) / 'figures', Path(sys.argv[1]) / 'gallery.md'\n"
        "made.main()"
    )
    shutil.copy(HERE / "docs" / "gallery.md", tmp_path)
    before = (tmp_path / "gallery.md").read_text(encoding="utf-8")
    (tmp_path / "gallery.md").write_text(
        before.partition("<!-- numbers")[0]
        + "<!-- numbers: written by make figures --><!-- end of numbers -->"
        + before.partition("<!-- end of numbers -->")[2],
        encoding="utf-8",
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path)], cwd=HERE / "docs", check=True, timeout=600)
    assert (tmp_path / "gallery.md").read_text(encoding="utf-8") == before
