"""Visible pixels of layers: with their filters, which GIMP 3 keeps apart from the pixels."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from gi.repository import Gegl, Gimp


@contextmanager
def as_seen(image: Gimp.Image, layer: Gimp.Layer) -> Iterator[Gimp.Layer]:
    """Yield the layer itself, or if it has filters a copy with these merged, outside of the image. Mask, mode
    and opacity are not applied.
    """
    if not _filters(layer):
        yield layer
        return
    scratch = Gimp.Image.new_with_precision(
        image.get_width(), image.get_height(), image.get_base_type(), image.get_precision()
    )
    scratch.undo_disable()
    try:
        profile = image.get_color_profile()
        if profile is not None:
            scratch.set_color_profile(profile)
        yield _merged(Gimp.Layer.new_from_drawable(layer, scratch), scratch)
    finally:
        scratch.delete()


def plain_copy(image: Gimp.Image, layer: Gimp.Layer, parent: Gimp.Layer | None, position: int) -> Gimp.Layer:
    """Insert a visible copy of a layer into the image: with an alpha channel, in Normal mode and opaque, with
    its mask applied and its filters merged, nothing locked.
    """
    with as_seen(image, layer) as seen:
        copy = layer.copy() if seen is layer else Gimp.Layer.new_from_drawable(seen, image)
        for unlock in (
            copy.set_lock_content,
            copy.set_lock_position,
            copy.set_lock_visibility,
            copy.set_lock_alpha,
        ):
            unlock(False)
        image.insert_layer(copy, parent, position)
        copy.set_name(layer.get_name())
    if copy.get_mask() is not None:
        copy.remove_mask(Gimp.MaskApplyMode.APPLY if copy.get_apply_mask() else Gimp.MaskApplyMode.DISCARD)
    if not copy.has_alpha() and not copy.is_group():
        copy.add_alpha()
    copy.set_mode(image.get_default_new_layer_mode())
    copy.set_opacity(100.0)
    copy.set_visible(True)
    return copy


def is_plain(layer: Gimp.Layer) -> bool:
    """Test whether a layer is opaque and in Normal mode, so that its copy looks as it does."""
    normal = (Gimp.LayerMode.NORMAL, Gimp.LayerMode.NORMAL_LEGACY, Gimp.LayerMode.PASS_THROUGH)
    return bool(layer.get_opacity() >= 100.0 and layer.get_mode() in normal)


def _filters(layer: Gimp.Layer) -> bool:
    return any(one.get_visible() for one in layer.get_filters())


def _merged(layer: Gimp.Layer, scratch: Gimp.Image) -> Gimp.Layer:
    """Return a layer of its own image with its filters merged; a group becomes an ordinary layer, under its
    mask.
    """
    for one in layer.get_filters():
        if not one.get_visible():
            one.delete()
    scratch.insert_layer(layer, None, 0)
    layer.set_visible(True)
    if not layer.is_group():
        layer.merge_filters()
        return layer
    mask, applied = layer.get_mask(), layer.get_apply_mask()
    kept = None if mask is None else _bytes(mask)
    if mask is not None:
        layer.remove_mask(Gimp.MaskApplyMode.DISCARD)
    merged = layer.merge()
    if kept is not None and len(kept) == merged.get_width() * merged.get_height() * 4:
        mask = merged.create_mask(Gimp.AddMaskType.WHITE)
        box = Gegl.Rectangle.new(0, 0, merged.get_width(), merged.get_height())
        mask.get_buffer().set(box, "Y float", kept)
        merged.add_mask(mask)
        merged.set_apply_mask(applied)
    return merged


def _bytes(drawable: Gimp.Drawable) -> bytes:
    box = Gegl.Rectangle.new(0, 0, drawable.get_width(), drawable.get_height())
    content: bytes = drawable.get_buffer().get(box, 1.0, "Y float", Gegl.AbyssPolicy.NONE)
    return content
