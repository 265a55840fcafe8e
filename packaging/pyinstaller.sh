#!/bin/sh
# A folder with a `toposeam` that needs no Python: packaging/pyinstaller.sh [FOLDER]; PyInstaller builds for the
# system that it runs on.
set -eu
cd "$(dirname "$0")/.."
target=${1:-dist/toposeam-alone}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT INT TERM
"${PYTHON:-python3}" -m venv "$work/venv"
bin=$work/venv/bin
[ -d "$bin" ] || bin=$work/venv/Scripts # on Windows
"$bin/python" -m pip install --quiet --disable-pip-version-check '.[cli]' pyinstaller
printf 'import multiprocessing\nfrom toposeam_cli.__main__ import start\n\nif __name__ == "__main__":\n    multiprocessing.freeze_support()\n    start()\n' >"$work/start.py"
# The public names are listed in stubs (.pyi), which are data; commands are imported by name.
"$bin/pyinstaller" --noconfirm --log-level ERROR --name toposeam --distpath "$work/dist" --workpath "$work/build" \
    --specpath "$work" --collect-all toposeam --collect-all toposeam_cli --collect-all toposeam_engine --collect-all toposeam_gimp --collect-all pyvips \
    --collect-binaries _libvips --hidden-import _libvips --collect-data skimage --copy-metadata toposeam "$work/start.py"
rm -rf "$target"
mkdir -p "$(dirname "$target")"
mv "$work/dist/toposeam" "$target"
echo "$target/toposeam"
