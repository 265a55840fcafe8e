"""Runs in GIMP's own Python: a server that lets the tests call the functions below. Images, layers and paths
travel as their ids.
"""

import hashlib
import json
import os
import socket
import traceback
from pathlib import Path

import gi

gi.require_version("Gimp", "3.0")
gi.require_version("Gegl", "0.4")
from gi.repository import Gegl, Gimp, Gio  # noqa: E402

FUNCTIONS = {}


def function(call):
    FUNCTIONS[call.__name__] = call
    return call


def image_of(number):
    return Gimp.Image.get_by_id(number)


def item(number):
    return Gimp.Item.get_by_id(number)


@function
def version():
    return Gimp.version()


@function
def procedures():
    names = Gimp.get_pdb().query_procedures("plug-in-toposeam.*", ".*", ".*", ".*", ".*", ".*", ".*", ".*")
    found = {}
    for name in names:
        procedure = Gimp.get_pdb().lookup_procedure(name)
        found[name] = {
            "label": procedure.get_menu_label(),
            "paths": list(procedure.get_menu_paths()),
            "blurb": procedure.get_blurb(),
            "help": procedure.get_help(),
            "arguments": [argument.get_name() for argument in procedure.get_arguments()],
        }
    return found


@function
def load(files, offsets=None, precision=None, gray=False, profile=None, alpha=True):
    """An image of one layer per file, the first the lowest; the canvas holds them all."""
    image = Gimp.file_load(Gimp.RunMode.NONINTERACTIVE, Gio.File.new_for_path(files[0]))
    if gray and image.get_base_type() != Gimp.ImageBaseType.GRAY:
        image.convert_grayscale()
    if precision:
        image.convert_precision(getattr(Gimp.Precision, precision))
    if profile:
        image.set_color_profile_from_file(Gio.File.new_for_path(profile))
    for file in files[1:]:
        layer = Gimp.file_load_layer(Gimp.RunMode.NONINTERACTIVE, image, Gio.File.new_for_path(file))
        image.insert_layer(layer, None, 0)
    layers = image.get_layers()[::-1]
    for layer, (x, y) in zip(layers, offsets or [(0, 0)] * len(layers), strict=True):
        layer.set_offsets(x, y)
        if alpha:
            layer.add_alpha()
    image.resize_to_layers()
    return {"image": image.get_id(), "layers": [layer.get_id() for layer in layers]}


@function
def python(code, **values):
    """For what only one test needs; the answer is what the code calls `answer`."""
    scope = {
        "Gimp": Gimp,
        "Gegl": Gegl,
        "Gio": Gio,
        "image_of": image_of,
        "item": item,
        "answer": None,
        **values,
    }
    exec(code, scope)  # noqa: S102 - the tests' own code
    return scope["answer"]


@function
def run(procedure, image, layers, options=None, mode="NONINTERACTIVE"):
    """Call a procedure: its status, message, and the layer it returns."""
    found = Gimp.get_pdb().lookup_procedure(procedure)
    config = found.create_config()
    config.set_property("run-mode", getattr(Gimp.RunMode, mode))
    config.set_property("image", image and image_of(image))
    config.set_core_object_array("drawables", [item(number) for number in layers])
    for name, value in (options or {}).items():
        config.set_property(name, value)
    result = found.run(config)
    status = result.index(0)
    answer = {"status": status.value_nick, "message": None, "layer": None}
    if status == Gimp.PDBStatusType.SUCCESS:
        layer = result.index(1)
        answer["layer"] = layer and layer.get_id()
    elif result.length() > 1:
        answer["message"] = str(getattr(result.index(1), "message", result.index(1)))
    if answer["message"] is None:
        answer["message"] = Gimp.get_pdb().get_last_error()
    return answer


@function
def tree(image):
    """Everything there is in an image, pixels as digests."""
    image = image_of(image)

    def describe(layer):
        about = {
            "name": layer.get_name(),
            "offsets": list(layer.get_offsets())[1:],
            "visible": layer.get_visible(),
            "opacity": layer.get_opacity(),
            "pixels": digest(layer),
            "mask": layer.get_mask() and digest(layer.get_mask()),
            "id": layer.get_id(),
        }
        if layer.is_group():
            about["children"] = [describe(child) for child in layer.get_children()]
        return about

    return {
        "layers": [describe(layer) for layer in image.get_layers()],
        "paths": [
            {"name": path.get_name(), "visible": path.get_visible(), "id": path.get_id()}
            for path in image.get_paths()
        ],
        "selection": digest(image.get_selection()),
        "size": [image.get_width(), image.get_height()],
    }


def digest(drawable):
    buffer = drawable.get_buffer()
    box = Gegl.Rectangle.new(0, 0, drawable.get_width(), drawable.get_height())
    return hashlib.sha256(buffer.get(box, 1.0, None, Gegl.AbyssPolicy.NONE)).hexdigest()


@function
def save_pixels(drawable, file, format_name):
    """Raw pixels of a drawable, in a format; its width, height and offsets."""
    drawable = item(drawable)
    box = Gegl.Rectangle.new(0, 0, drawable.get_width(), drawable.get_height())
    Path(file).write_bytes(drawable.get_buffer().get(box, 1.0, format_name, Gegl.AbyssPolicy.NONE))
    return [drawable.get_width(), drawable.get_height(), *list(drawable.get_offsets())[1:]]


@function
def save_projection(image, file, format_name):
    """What the image looks like, as raw pixels."""
    layer = Gimp.Layer.new_from_visible(image_of(image), image_of(image), "visible")
    box = Gegl.Rectangle.new(0, 0, layer.get_width(), layer.get_height())
    Path(file).write_bytes(layer.get_buffer().get(box, 1.0, format_name, Gegl.AbyssPolicy.NONE))
    return [layer.get_width(), layer.get_height()]


@function
def strokes(path):
    path = item(path)
    found = []
    for stroke in path.get_strokes():
        _kind, points, closed = path.stroke_get_points(stroke)
        found.append({"points": list(points), "closed": closed})
    return found


@function
def export(image, file):
    return Gimp.file_save(Gimp.RunMode.NONINTERACTIVE, image_of(image), Gio.File.new_for_path(file), None)


@function
def export_layer(layer, file):
    """One layer, alone, as a file of the image's depth and profile."""
    layer = item(layer)
    image = layer.get_image()
    alone = Gimp.Image.new_with_precision(
        layer.get_width(), layer.get_height(), image.get_base_type(), image.get_precision()
    )
    profile = image.get_color_profile()
    if profile is not None:
        alone.set_color_profile(profile)
    copy = Gimp.Layer.new_from_drawable(layer, alone)
    alone.insert_layer(copy, None, 0)
    copy.set_offsets(0, 0)
    copy.set_visible(True)
    saved = Gimp.file_save(Gimp.RunMode.NONINTERACTIVE, alone, Gio.File.new_for_path(file), None)
    alone.delete()
    return saved


@function
def delete(image):
    image_of(image).delete()


def serve(address):
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(address)
        server.listen(1)
        connection, _ = server.accept()
        with connection.makefile("rw", encoding="utf-8") as line:
            for request in line:
                name, values = json.loads(request)
                if name == "quit":
                    break
                try:
                    answer = {"answer": FUNCTIONS[name](**values)}
                except Exception:
                    answer = {"error": traceback.format_exc()}
                line.write(json.dumps(answer) + "\n")
                line.flush()


if "TOPOSEAM_TEST_SOCKET" in os.environ:
    serve(os.environ["TOPOSEAM_TEST_SOCKET"])
