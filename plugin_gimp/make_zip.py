"""Pack the plug-in for people without a terminal: one folder, to be unpacked into GIMP's plug-ins folder.
``make plugin-zip``.
"""

import sys
import zipfile
from pathlib import Path

HERE = Path(__file__).parent
PLUG_IN = "toposeam_gimp"
_KINDS = (".py", ".mo", ".png", ".svg")


def make_zip(target: Path) -> Path:
    """Write the archive; the main file stays executable."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted((HERE / PLUG_IN).rglob("*")):
            if path.is_file() and path.suffix in _KINDS and "__pycache__" not in path.parts:
                entry = zipfile.ZipInfo(path.relative_to(HERE).as_posix(), (2026, 1, 1, 0, 0, 0))
                entry.external_attr = (0o755 if path.stem == PLUG_IN else 0o644) << 16
                entry.create_system = 3  # Unix: otherwise the rights are not looked at
                archive.writestr(entry, path.read_bytes(), zipfile.ZIP_DEFLATED)
    return target


if __name__ == "__main__":
    print(make_zip(Path(sys.argv[1])))  # noqa: T201
