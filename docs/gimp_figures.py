"""The pictures of docs/gimp.md, made in a real GIMP: ``make gimp-figures``."""

import gettext
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyvips

HERE = Path(__file__).parent
SAMPLES = HERE.parent / "samples"
sys.path[:0] = [str(HERE.parent / "tests" / "gimp"), str(HERE.parent / "plugin_gimp"), str(SAMPLES)]

from clips import flames  # noqa: E402
from running import Gimp, Screen, find_gimp  # noqa: E402

from toposeam_gimp.entries.table import PROCEDURES  # noqa: E402

RGB = "R'G'B'A u8"
pyvips.cache_set_max(0)  # files are photographed over and over under one name


#: How long a preview may take, on a machine with other things to do.
PREVIEW_S = 90


def main() -> None:
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "figures"
    with windowed() as (gimp, screen):
        for figure in (stitch, patch, synthesize, tile, fill, motif):
            figure(gimp, target)
        windows(gimp, screen, target)
        dialogs(gimp, screen, target)
    for language, scale in (("ko", 1), ("en", 2), ("ko", 2)):
        with windowed(language, scale) as (gimp, screen):
            if (language, scale) == ("ko", 2):
                windows(gimp, screen, target, language, scale)
            dialogs(gimp, screen, target, language, scale)


@contextmanager
def windowed(language: str = "en", scale: int = 1) -> Iterator[tuple[Gimp, Screen]]:
    """A GIMP with a window, in a language and at a scale of the screen."""
    screen = Screen(1500 * scale, 800 * scale)
    environment = {"DISPLAY": screen.display, "GDK_SCALE": str(scale), "LANGUAGE": language}
    if language != "en":
        # Debian makes locales when somebody asks for them.
        made = ["localedef", "-i", "ko_KR", "-f", "UTF-8", "ko_KR.UTF-8"]
        subprocess.run(made, check=False)  # noqa: S603
        environment["LC_ALL"] = environment["LANG"] = "ko_KR.UTF-8"
    with tempfile.TemporaryDirectory() as scratch:
        gimp = Gimp(Path(scratch), environment, [find_gimp("gimp"), "--no-splash", "--new-instance"])
        try:
            yield gimp, screen
        finally:
            gimp.close()
            screen.close()


def run(gimp: Gimp, name: str, loaded: dict[str, Any], layers: list[int], **options: Any) -> int:
    named = {key.replace("_", "-"): value for key, value in options.items()}
    result = gimp.run(
        procedure=f"plug-in-toposeam-{name}", image=loaded.get("image"), layers=layers, options=named
    )
    if result["status"] != "success":
        raise RuntimeError(result["message"])
    return int(result["layer"])


def seen(gimp: Gimp, image: int) -> np.ndarray:
    return on_checks(gimp.projection(image, RGB))


def on_checks(pixels: np.ndarray) -> np.ndarray:
    """RGBA on the checkerboard that stands for transparency."""
    y, x = np.mgrid[: pixels.shape[0], : pixels.shape[1]]
    checks = np.where((y // 8 + x // 8) % 2, 150, 105)[..., None]
    share = pixels[..., 3:] / 255
    return np.round(pixels[..., :3] * share + checks * (1 - share)).astype(np.uint8)


def draw_paths(gimp: Gimp, image: int, picture: np.ndarray) -> np.ndarray:
    """The picture with the path to bend, the uppermost, over it."""
    code = """
answer = []
for path in image_of(number).get_paths()[:1]:
    for stroke in path.get_strokes():
        points, closed = path.stroke_interpolate(stroke, 0.2)
        answer.append(list(points) + (list(points[:2]) if closed else []))
"""
    drawn = picture.copy()
    for line in gimp.python(code=code, number=image):
        points = np.array(line).reshape(-1, 2)
        steps = np.concatenate(
            [np.linspace(a, b, 4 * int(np.hypot(*(b - a))) + 2) for a, b in pairwise(points)]
        )
        for dx in (-1, 0):
            for dy in (-1, 0):
                y, x = (
                    np.clip(np.round(steps[:, axis]).astype(int) + d, 0, drawn.shape[1 - axis] - 1)
                    for axis, d in ((1, dy), (0, dx))
                )
                drawn[y, x] = (255, 40, 160)
    return drawn


def beside(file: Path, *pictures: np.ndarray, height: int = 230) -> None:
    """Pictures of one height side by side, with few colours so that the file stays small."""
    images = [pyvips.Image.new_from_array(picture) for picture in pictures]
    images = [
        image.resize(height / image.height, kernel="nearest" if height > image.height else "lanczos3")
        for image in images
    ]
    joined = (
        pyvips.Image.arrayjoin(images, across=len(images), shim=8, background=[255, 255, 255])
        if _even(images)
        else _row(images)
    )
    joined.write_to_file(str(file), palette=True, Q=90, compression=9)
    print(file, file.stat().st_size // 1024, "KiB")


def _even(images: list[Any]) -> bool:
    return len({(image.width, image.height) for image in images}) == 1


def _row(images: list[Any]) -> Any:
    joined = images[0]
    for image in images[1:]:
        joined = joined.join(image, "horizontal", shim=8, expand=True, background=[255, 255, 255])
    return joined


def load(gimp: Gimp, *names: str, offsets: list[list[int]] | None = None) -> dict[str, Any]:
    loaded: dict[str, Any] = gimp.load(files=[str(SAMPLES / name) for name in names], offsets=offsets)
    return loaded


def stitch(gimp: Gimp, target: Path) -> None:
    loaded = load(gimp, "still_life_left.png", "still_life_right.png", offsets=[[0, 0], [270, 0]])
    before = seen(gimp, loaded["image"])
    group = run(gimp, "stitch", loaded, loaded["layers"])
    after = seen(gimp, loaded["image"])
    beside(target / "gimp-stitch.png", before, draw_paths(gimp, loaded["image"], after), after)
    code = """
path = image_of(number).get_paths()[0]
for stroke in path.get_strokes():
    path.remove_stroke(stroke)
controls = [345, 0, 345, 0, 345, 120, 420, 150, 420, 250, 420, 350, 350, 380, 350, 500, 350, 500]
path.stroke_new_from_points(Gimp.PathStrokeType.BEZIER, [float(value) for value in controls], False)
"""
    gimp.python(code=code, number=loaded["image"])
    run(gimp, "restitch", loaded, [group])
    bent = seen(gimp, loaded["image"])
    beside(
        target / "gimp-restitch.png",
        draw_paths(gimp, loaded["image"], after),
        draw_paths(gimp, loaded["image"], bent),
    )


def patch(gimp: Gimp, target: Path) -> None:
    loaded = load(gimp, "sky_b.png", "sky_b.png")
    # Cloning: a copy of the picture, moved, of which the selected part covers what lies below.
    code = """
image, layer = image_of(number), item(layer)
layer.set_offsets(-44, 26)
image.select_ellipse(Gimp.ChannelOps.REPLACE, 30, 60, 76, 80)
"""
    before = seen(gimp, loaded["image"])
    gimp.python(code=code, number=loaded["image"], layer=loaded["layers"][1])
    moved = seen(gimp, loaded["image"])
    run(gimp, "patch", loaded, loaded["layers"][1:], blend="gradient")
    after = seen(gimp, loaded["image"])
    beside(target / "gimp-patch.png", before, moved, draw_paths(gimp, loaded["image"], after), after)


def synthesize(gimp: Gimp, target: Path) -> None:
    loaded = load(gimp, "grass_a.png")
    made = run(gimp, "synthesize", loaded, loaded["layers"], width=480, height=320, patch=40)
    small = np.full((320, 160, 3), 255, np.uint8)
    small[80:240] = seen(gimp, loaded["image"])
    beside(target / "gimp-synthesize.png", small, on_checks(gimp.pixels(made, RGB)[0]))


def tile(gimp: Gimp, target: Path) -> None:
    loaded = load(gimp, "grass_b.png")
    before = np.tile(seen(gimp, loaded["image"]), (2, 2, 1))
    run(gimp, "tile", loaded, loaded["layers"], band=24)
    beside(target / "gimp-tile.png", before, np.tile(seen(gimp, loaded["image"]), (2, 2, 1)))


def fill(gimp: Gimp, target: Path) -> None:
    loaded = load(gimp, "sky_b.png")
    before = seen(gimp, loaded["image"])
    gimp.python(
        code="image_of(number).select_ellipse(Gimp.ChannelOps.REPLACE, 26, 76, 62, 52)",
        number=loaded["image"],
    )
    angle = np.linspace(0, 2 * np.pi, 800)
    marked = before.copy()
    marked[np.round(102 + 26 * np.sin(angle)).astype(int), np.round(57 + 31 * np.cos(angle)).astype(int)] = (
        255,
        40,
        160,
    )
    run(gimp, "fill", loaded, loaded["layers"])
    beside(target / "gimp-fill.png", marked, seen(gimp, loaded["image"]))


def motif(gimp: Gimp, target: Path) -> None:
    pictures = []
    for seed, rule, palette in ((3, "p4m", "fall"), (8, "translate", "sea")):
        group = run(gimp, "motif", {}, [], size=160, repeat=rule, palette=palette, seed=seed)
        number = gimp.python(code="answer = item(number).get_image().get_id()", number=group)
        pictures.append(seen(gimp, number))
        pattern = run(gimp, "repeat", {"image": number}, [group], rows=3, columns=3)
        pictures.append(
            seen(gimp, gimp.python(code="answer = item(number).get_image().get_id()", number=pattern))
        )
    beside(target / "gimp-motif.png", *pictures)


def windows(gimp: Gimp, screen: Screen, target: Path, language: str = "en", scale: int = 1) -> None:
    """The menu and the window with the result."""
    name = "" if (language, scale) == ("en", 1) else f"-{language}-{scale}x"
    loaded = load(gimp, "still_life_left.png", "still_life_right.png", offsets=[[0, 0], [270, 0]])
    code = """
Gimp.Display.new(image_of(number))
image_of(number).set_selected_layers([item(layer) for layer in layers])
"""
    gimp.python(code=code, number=loaded["image"], layers=loaded["layers"])
    window = screen.window("– (GIMP|김프)")
    screen.do("windowmove", window, 0, 0)
    screen.do("windowsize", "--sync", window, 1180 * scale, 760 * scale)
    time.sleep(2)
    screen.press(window, "shift+ctrl+j", "alt+r")
    time.sleep(1)
    for key in ("Up", "Right", "Right"):
        screen.do("key", key)
        time.sleep(1)
    file, size = target / f"gimp-menu{name}.png", (1180 * scale, 784 * scale)
    shoot(screen, file, lambda file: screen.shoot(file), 0.6, crop=size)
    screen.do("key", "Escape", "Escape", "Escape", "Escape")
    run(gimp, "stitch", loaded, loaded["layers"], show_seam=True)
    gimp.python(code="Gimp.displays_flush()")
    time.sleep(3)
    shoot(screen, target / f"gimp-window{name}.png", lambda file: screen.shoot(file, window), 0.7)


#: The dialogs that are photographed.
DIALOGS = ("panorama", "stitch", "patch", "synthesize", "tile", "fill", "motif", "repeat", "loop")
#: So many stand beside each other on the sheets in Korean and of a fine screen.
COLUMNS = 3


def dialogs(gimp: Gimp, screen: Screen, target: Path, language: str = "en", scale: int = 1) -> None:
    """Dialogs with their previews: in English on an ordinary screen one file each, else all on one sheet."""
    plain, shown = language == "en" and scale == 1, []
    for name in DIALOGS:
        entry = PROCEDURES[f"plug-in-toposeam-{name}"]
        loaded = opened(gimp, name)
        layers = loaded["layers"] if name in ("panorama", "stitch") else loaded["layers"][-1:]
        call = {"procedure": entry.name, "image": loaded["image"], "layers": layers, "mode": "INTERACTIVE"}
        asked = threading.Thread(target=lambda call=call: gimp.run(**call), daemon=True)
        asked.start()
        dialog = screen.window(translated(entry.title, language))
        screen.do("mousemove", 1490 * scale, 790 * scale)
        wait_for_preview(screen, dialog, entry.preview is not None)
        file = target / f"gimp-dialog-{name}.png"
        if plain:
            shoot(screen, file, lambda file, dialog=dialog: screen.shoot(file, dialog), 0.75)
            if name == "motif":
                rules(screen, dialog, target)
        else:
            screen.shoot(file.with_suffix(".part.png"), dialog)
            shown.append(np.asarray(pyvips.Image.new_from_file(str(file.with_suffix(".part.png")))[:3]))
            file.with_suffix(".part.png").unlink()
        screen.press(dialog, "Escape")
        asked.join(60)
    if shown:
        sheet(target / f"gimp-dialogs-{language}-{scale}x.png", shown)


def sheet(file: Path, pictures: list[np.ndarray]) -> None:
    """Pictures of about one size in rows, as they are."""
    images = [pyvips.Image.new_from_array(picture) for picture in pictures]
    white = {"shim": 16, "background": [255, 255, 255]}
    pyvips.Image.arrayjoin(images, across=COLUMNS, **white).write_to_file(
        str(file), palette=True, Q=90, compression=9
    )
    print(file, file.stat().st_size // 1024, "KiB")


def opened(gimp: Gimp, name: str) -> dict[str, Any]:
    """What a dialog is shown with."""
    if name == "repeat":
        group = run(gimp, "motif", {}, [], size=96, iterations=12, repeat="p4m", palette="terracotta")
        number = gimp.python(code="answer = item(number).get_image().get_id()", number=group)
        return {"image": number, "layers": [group]}
    if name in ("synthesize", "tile"):
        return load(gimp, "grass_a.png")
    if name == "loop":
        with tempfile.TemporaryDirectory() as scratch:
            for index, frame in enumerate(flames(24, 90, 120)):
                picture = pyvips.Image.new_from_array(frame)
                picture.write_to_file(str(Path(scratch) / f"{index:02}.png"))
            loaded = gimp.load(files=sorted(map(str, Path(scratch).iterdir())), alpha=False)
        return dict(loaded)
    if name == "fill":
        loaded = load(gimp, "sky_b.png")
        code = "image_of(number).select_ellipse(Gimp.ChannelOps.REPLACE, 26, 76, 62, 52)"
        gimp.python(code=code, number=loaded["image"])
        return loaded
    offsets = [[0, 0], [0, 0]] if name == "panorama" else [[0, 0], [270, 0]]
    loaded = load(gimp, "still_life_left.png", "still_life_right.png", offsets=offsets)
    if name == "patch":
        code = "image_of(number).select_ellipse(Gimp.ChannelOps.REPLACE, 330, 140, 100, 200)"
        gimp.python(code=code, number=loaded["image"])
    return loaded


def translated(title: str, language: str) -> str:
    """What stands in the title of a dialog."""
    folder = HERE.parent / "plugin_gimp" / "toposeam_gimp" / "locale"
    texts = gettext.translation("toposeam_gimp", folder, [language], fallback=True)
    for entry in PROCEDURES.values():
        if entry.title == title:
            return re.sub(r"\(_\w\)|_", "", texts.gettext(entry.label)).rstrip(".")
    raise KeyError(title)


def rules(screen: Screen, dialog: str, target: Path) -> None:
    """The menu of rules, open, over its dialog."""
    screen.press(dialog, "alt+b")
    time.sleep(2)
    about = dict(line.split("=") for line in screen.do("getwindowgeometry", "--shell", dialog).split())
    box = int(about["X"]), int(about["Y"]), int(about["WIDTH"]), int(about["HEIGHT"])
    file = target / "gimp-dialog-rules.png"
    screen.shoot(file)
    image = pyvips.Image.new_from_file(str(file))[:3]
    size = min(box[2] + 240, image.width - box[0]), min(box[3], image.height - box[1])
    image = image.crop(*box[:2], *size)
    image.resize(0.75).copy_memory().write_to_file(str(file), palette=True, Q=80, compression=9)
    screen.do("key", "Escape")
    time.sleep(1)


def wait_for_preview(screen: Screen, dialog: str, comes: bool) -> None:
    """Until the left part of a dialog shows a picture."""
    deadline, seen = time.monotonic() + PREVIEW_S, 0
    with tempfile.TemporaryDirectory() as scratch:
        file = str(Path(scratch) / "dialog.png")
        while comes and seen < 2 and time.monotonic() < deadline:  # twice: a window that opens is not even
            screen.shoot(file, dialog)
            picture = pyvips.Image.new_from_file(file)
            varied = picture.crop(20, 20, picture.width // 3, picture.height // 2).deviate() > 2
            seen = seen + 1 if varied else 0
            time.sleep(1)
    time.sleep(1)


def shoot(
    screen: Screen,
    file: Path,
    take: Callable[[Path], None],
    scale: float,
    crop: tuple[int, int] | None = None,
) -> None:
    take(file)
    image = pyvips.Image.new_from_file(str(file))[:3]
    image = (image if crop is None else image.crop(0, 0, *crop)).resize(scale).copy_memory()
    image.write_to_file(str(file), palette=True, Q=80, compression=9)
    print(file, file.stat().st_size // 1024, "KiB")


if __name__ == "__main__":
    main()
