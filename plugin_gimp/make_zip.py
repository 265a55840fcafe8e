"""Pack the plug-in for people without a terminal: one folder, to be unpacked into GIMP's plug-ins folder,
with a guide, and the wheel of which the plug-in makes its engine. ``make plugin-zip``.
"""

import sys
import zipfile
from pathlib import Path

HERE = Path(__file__).parent
PLUG_IN = "toposeam_gimp"
_KINDS = (".py", ".mo", ".png", ".svg")


def make_zip(target: Path, wheel: Path | None = None) -> Path:
    """Write the archive; the main file stays executable."""
    target.parent.mkdir(parents=True, exist_ok=True)
    files = {"GUIDE.txt": HERE / "GUIDE.md"} | ({} if wheel is None else {f"wheel/{wheel.name}": wheel})
    for path in (HERE / PLUG_IN).rglob("*"):
        if path.is_file() and path.suffix in _KINDS and "__pycache__" not in path.parts:
            files[path.relative_to(HERE / PLUG_IN).as_posix()] = path
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, path in sorted(files.items()):
            entry = zipfile.ZipInfo(f"{PLUG_IN}/{name}", (2026, 1, 1, 0, 0, 0))
            entry.external_attr = (0o755 if name == f"{PLUG_IN}.py" else 0o644) << 16
            entry.create_system = 3  # Unix: otherwise the rights are not looked at
            archive.writestr(entry, path.read_bytes(), zipfile.ZIP_DEFLATED)
    return target


if __name__ == "__main__":
    print(make_zip(*map(Path, sys.argv[1:])))  # noqa: T201
