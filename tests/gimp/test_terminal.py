"""The one-liners of the manual, run by a console GIMP as they stand there."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from pictures import photograph, write_png
from PIL import Image
from running import CHECKOUT, find_gimp, needs_gimp

from toposeam_gimp.entries.table import PROCEDURES

needs_gimp()

LINES = re.findall(r"^gimp-console-3\.0 (.*) -b '(.*)'$", (CHECKOUT / "docs" / "gimp.md").read_text(), re.M)


def test_every_procedure_has_a_line_and_every_line_works(tmp_path, samples):
    assert {name for _, code in LINES for name in PROCEDURES if name + " " in code} == set(PROCEDURES)
    (switches,) = {switches for switches, _ in LINES}
    profile = tmp_path / "profile"
    profile.mkdir()
    (profile / "gimprc").write_text(
        f'(plug-in-path "{CHECKOUT / "plugin_gimp"}:${{gimp_plug_in_dir}}/plug-ins")\n'
    )
    for source, name in (("still_life_left.png", "left"), ("still_life_right.png", "right")):
        shutil.copy(samples / source, tmp_path / f"{name}.png")
    write_png(tmp_path / "stone.png", photograph(96, 120))
    whole = photograph(40, 200)
    frames = [Image.fromarray(whole[:, 12 * (time % 6) : 12 * (time % 6) + 60]) for time in range(12)]
    frames[0].save(
        tmp_path / "clip.webp", save_all=True, append_images=frames[1:], duration=80, lossless=True
    )
    own = {str(CHECKOUT / ".venv" / "bin"), str(Path(sys.executable).parent)}
    path = os.pathsep.join(part for part in os.environ["PATH"].split(os.pathsep) if part not in own)
    told = {"GIMP3_DIRECTORY": str(profile), "TOPOSEAM_PYTHON": sys.executable, "PATH": path}
    command = [find_gimp(), *switches.split()]
    for _, code in LINES:
        command += ["-b", code]
    ended = subprocess.run(
        command,
        cwd=tmp_path,
        env={**os.environ, **told},
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr[-3000:]
    saved = r'file-save RUN-NONINTERACTIVE image "(\w+\.\w+)"'
    wanted = {name for _, code in LINES for name in re.findall(saved, code)}
    assert len(wanted) == len(LINES)
    for name in wanted:
        assert (tmp_path / name).stat().st_size > 500, name
