"""Stacks that somebody else made: each ends in one sentence, before memory or time is spent on it."""

import json
import os
import shutil
import zlib

import numpy as np
import pytest

from toposeam_cli.media.stacks.unpacking import unpacks_within

tifffile = pytest.importorskip("tifffile")
zarr = pytest.importorskip("zarr")


@pytest.fixture
def stack(tmp_path):
    """(20, 26, 24) uint8, saved as ``a.npy``."""
    voxels = np.random.default_rng(0).integers(0, 256, (20, 26, 24)).astype(np.uint8)
    np.save(tmp_path / "a.npy", voxels)
    return voxels


@pytest.fixture
def joined(toposeam, tmp_path, stack):
    """Join ``a.npy`` and a file, 16 voxels to the right."""

    def run(path, *more):
        return toposeam(
            "volume", tmp_path / "a.npy", path, "--offset", "0,0,16", "-o", tmp_path / "o.npy", *more
        )

    return run


def saved(path, voxels, **options):
    settings = {"zarr_format": 2, "chunks": (8, 16, 16), **options}
    zarr.create_array(str(path), data=voxels, **settings)
    return path


def described(path, **changes):
    """Change the metadata of an array."""
    for name in (".zarray", "zarr.json"):
        if (path / name).exists():
            (path / name).write_text(json.dumps({**json.loads((path / name).read_text()), **changes}))
    return path


def ome(path, voxels, old, new):
    tifffile.imwrite(path, voxels, ome=True, metadata={"axes": "ZYX"}, compression="zlib")
    found = tifffile.tiffcomment(path)
    assert old in found
    tifffile.tiffcomment(path, found.replace(old, new, 1).encode())
    return path


@pytest.mark.parametrize("place", ["compressor", "filters"])
@pytest.mark.parametrize("codec", ["pickle", "json2", "vlen-utf8", "own"])
def test_codecs_that_are_not_known_are_never_asked(joined, stack, tmp_path, place, codec):
    path = saved(tmp_path / "b.zarr", stack, compressors=None)
    described(path, **{place: {"id": codec} if place == "compressor" else [{"id": codec}]})
    joined(path).fails(f"is packed with {codec}, which is not read; export it with blosc")


def test_chunks_that_were_packed_twice_are_refused(joined, stack, tmp_path):
    path = described(saved(tmp_path / "b.zarr", stack), filters=[{"id": "zlib"}])
    joined(path).fails("is packed in a way that is not read; export it with one compressor")


def test_codecs_of_the_third_format_are_checked(joined, stack, tmp_path):
    path = saved(tmp_path / "b.zarr", stack, zarr_format=3)
    pickled = {"name": "numcodecs.pickle", "configuration": {"protocol": 5}}
    described(path, codecs=[{"name": "bytes"}, pickled])
    joined(path).fails("is packed with pickle, which is not read")
    shard = {
        "chunk_shape": [4, 4, 4],
        "codecs": [{"name": "bytes"}, pickled],
        "index_codecs": [{"name": "bytes"}],
    }
    described(path, codecs=[{"name": "sharding_indexed", "configuration": shard}])
    joined(path).fails("is packed with pickle, which is not read")
    described(path, storage_transformers=[{"name": "own"}])
    joined(path).fails("laid out in a way that is not read")


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"compressors": None},
        {"zarr_format": 3},
        {"zarr_format": 3, "shards": (16, 32, 32), "chunks": (4, 16, 16)},
        {"zarr_format": 3, "compressors": "numcodecs.zarr3.Zlib"},
        *({"compressors": name} for name in ("Blosc", "Zlib", "GZip", "BZ2", "LZMA", "LZ4", "Zstd")),
        {"filters": "Delta", "compressors": "Zlib"},
    ],
    ids=str,
)
@pytest.mark.filterwarnings("ignore")  # zarr says that numcodecs' are not in its specification
def test_usual_codecs_are_read(joined, stack, tmp_path, options):
    import numcodecs
    import numcodecs.zarr3

    made = dict(options)
    if isinstance(name := options.get("compressors"), str):
        made["compressors"] = numcodecs.zarr3.Zlib() if "." in name else getattr(numcodecs, name)()
    if "filters" in options:
        made["filters"] = [numcodecs.Delta(dtype="u1")]
    path = saved(tmp_path / "b.zarr", stack, **made)
    for block in ((), ("--block", "16")):
        ran = joined(path, *block, "--force")
        assert ran.code == 0, ran
        whole = np.load(tmp_path / "o.npy")
        assert (whole[:, :, 24:] == stack[:, :, 8:]).all()


@pytest.mark.parametrize("shape", [[10**6] * 3, [10**9, 10**9, 10**9], [-1, 4, 4], ["x", 1, 1], 7, None])
def test_sizes_of_zarrs_are_checked_first(joined, stack, tmp_path, shape):
    path = described(saved(tmp_path / "b.zarr", stack), shape=shape)
    joined(path).fails("voxels, more than the 1e+10 allowed" if shape == [10**6] * 3 else "b.zarr")


def test_zarrs_of_too_many_chunks_are_refused(joined, stack, tmp_path):
    path = described(saved(tmp_path / "b.zarr", stack), shape=[2000] * 3, chunks=[1] * 3)
    joined(path).fails("is cut into 8000000000 chunks of 1×1×1 voxels; export it with chunks of")
    described(path, chunks=[0, 1, 1])
    joined(path).fails("its shape is 0×1×1")
    described(path, chunks=[10**5] * 3)
    joined(path).fails("export it with chunks of")


@pytest.mark.parametrize("method", ["zlib", "gzip", "bz2", "lzma", "zstd", "blosc", "lz4"])
def test_chunks_that_unpack_to_more_are_refused(joined, stack, tmp_path, method):
    import numcodecs

    path = saved(tmp_path / "b.zarr", stack, compressors=numcodecs.get_codec({"id": method}))
    packed = numcodecs.get_codec({"id": method}).encode(
        np.zeros(20_000_000 if method != "zstd" else 80_000_000, np.uint8)
    )
    (path / "0.0.0").write_bytes(packed)
    joined(path).fails("unpacks to more than its chunks hold")


@pytest.mark.parametrize("blocks", [512, 513])
def test_every_block_of_a_frame_counts_an_empty_one_too(blocks):
    """However little is wanted, as many blocks may come as can hold 64 MiB."""
    repeated = (128 << 10 << 3 | 2).to_bytes(3, "little") + b"a"
    frame = b"\x28\xb5\x2f\xfd\0\x58" + (blocks - 1) * repeated + bytes([1, 0, 0])
    assert unpacks_within(frame, "zstd", 1000) == (blocks == 512)


@pytest.mark.parametrize("length", [0, 3, 40])
@pytest.mark.parametrize("packed", [True, False])
def test_chunks_cut_short_end_in_one_sentence(joined, stack, tmp_path, length, packed):
    path = saved(tmp_path / "b.zarr", stack, **({} if packed else {"compressors": None}))
    chunk = path / "0.0.0"
    chunk.write_bytes(chunk.read_bytes()[:length])
    for block in ((), ("--block", "16")):
        joined(path, *block).fails("it is damaged or cut short; copy or save it again")


def test_arrays_outside_of_a_zarr_are_not_read(joined, stack, tmp_path):
    saved(tmp_path / "outside.zarr", stack)
    group = tmp_path / "b.zarr"
    group.mkdir()
    (group / ".zgroup").write_text('{"zarr_format": 2}')
    for name in ("../outside.zarr", str(tmp_path / "outside.zarr")):
        scales = [{"axes": [], "datasets": [{"path": name}]}]
        (group / ".zattrs").write_text(json.dumps({"multiscales": scales}))
        joined(group).fails("which is outside of it")
    (group / ".zattrs").write_text("{" * 100_000)
    joined(group).fails("b.zarr cannot be read as a stack")


@pytest.mark.parametrize(
    ("old", "new", "phrase"),
    [
        ('IFD="0" PlaneCount="20"', 'IFD="0" PlaneCount="1000000000"', "says that it has 1e+09 slices"),
        ('SizeZ="20"', 'SizeZ="2000000000"', "voxels, more than the 1e+10 allowed"),
        ('SizeZ="20"', 'SizeZ="-20"', "slices"),
        ("</TiffData>", '<UUID FileName="../x.tif">urn:u</UUID></TiffData>', "only files in its own folder"),
        (
            "</TiffData>",
            '<UUID FileName="/etc/passwd">urn:u</UUID></TiffData>',
            "only files in its own folder",
        ),
        ("</TiffData>", '<UUID FileName="pipe">urn:u</UUID></TiffData>', "only files in its own folder"),
        (
            "</TiffData>",
            '<UUID FileName="c.tif">urn:u</UUID></TiffData>',
            "put all its files into one folder",
        ),
        ("<OME ", '<!DOCTYPE O [<!ENTITY a "b">]><OME ', "cannot be read as a stack"),
    ],
    ids=["planes", "size", "negative", "above", "absolute", "pipe", "missing", "entity"],
)
def test_what_ome_says_is_checked(joined, stack, tmp_path, old, new, phrase):
    os.mkfifo(tmp_path / "pipe")
    path = tmp_path / "b.ome.tif"
    tifffile.imwrite(path, stack, ome=True, metadata={"axes": "ZYX"}, compression="zlib")
    if "UUID" in new:
        text = tifffile.tiffcomment(path)
        old = text[text.index("<TiffData") :].partition("/>")[0] + "/>"
        new = old.replace("/>", ">") + new
    ome(path, stack, old, new)
    joined(path).fails(phrase)


def test_slices_in_several_files_are_read(joined, stack, tmp_path):
    """An OME-TIFF whose second half is a file of its own."""
    files = [tmp_path / "set" / f"{number}.ome.tif" for number in range(2)]
    files[0].parent.mkdir()
    for file, part in zip(files, (stack[:12], stack[12:]), strict=True):
        tifffile.imwrite(
            file, part, photometric="minisblack", compression="zlib", description="x", metadata=None
        )
    data = "".join(
        f'<TiffData FirstZ="{first}" IFD="0" PlaneCount="{count}">'
        f'<UUID FileName="{file.name}">{file.name}</UUID></TiffData>'
        for file, first, count in zip(files, (0, 12), (12, 8), strict=True)
    )
    text = (
        '<OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06" UUID="0.ome.tif"><Image ID="I:0">'
        '<Pixels ID="Pixels:0" DimensionOrder="XYZCT" Type="uint8" SizeX="24" SizeY="26" SizeZ="20" '
        f'SizeC="1" SizeT="1"><Channel ID="Channel:0:0" SamplesPerPixel="1"/>{data}</Pixels></Image></OME>'
    )
    tifffile.tiffcomment(files[0], text.encode())
    ran = joined(files[0])
    assert ran.code == 0, ran
    assert (np.load(tmp_path / "o.npy")[:, :, 24:] == stack[:, :, 8:]).all()
    files[1].unlink()
    joined(files[0], "--force").fails(
        "has slices in '1.ome.tif', which is not there; put all its files into one"
    )


def test_slices_that_unpack_to_more_are_refused(joined, stack, tmp_path):
    path = tmp_path / "b.tif"
    tifffile.imwrite(path, stack, compression="zlib", metadata={"axes": "ZYX"})
    bomb = zlib.compress(bytes(50_000_000), 9)
    with tifffile.TiffFile(path, mode="r+b") as file:
        page = file.pages[3]
        at = file.filehandle.size
        file.filehandle.seek(at)
        file.filehandle.write(bomb)
        page.tags["StripOffsets"].overwrite(at)
        page.tags["StripByteCounts"].overwrite(len(bomb))
    joined(path).fails("unpacks to more than its slices hold")


def test_a_compressed_stack_is_parsed_once(monkeypatch, tmp_path, stack):
    """However many slices are read."""
    from toposeam_cli.media.stacks.reading import read_stack

    path, parsed = tmp_path / "b.tif", []
    tifffile.imwrite(path, stack, compression="zlib", metadata={"axes": "ZYX"})
    original = tifffile.TiffFile.__init__
    monkeypatch.setattr(
        tifffile.TiffFile, "__init__", lambda self, *a, **k: (parsed.append(1), original(self, *a, **k))[1]
    )
    np.testing.assert_array_equal(np.asarray(read_stack(path).voxels), stack)
    assert len(parsed) == 1


@pytest.mark.parametrize(
    "header",
    [
        b"{'descr': '|u1', 'fortran_order': False, 'shape': (True, 20, 26), }",
        b"{'descr': '|u1', 'fortran_order': False, 'shape': (20, 26, 24",
        b"{'descr': '|u1', 'fortran_order': False, 'shape': (-20, 26, 24), }",
        b"\x00\x01'''",
        b"{'descr': '|O', 'fortran_order': False, 'shape': (20, 26, 24), }",
    ],
)
def test_damaged_headers_end_in_one_sentence(joined, stack, tmp_path, header):
    body = header.ljust(117) + b"\n"
    content = b"\x93NUMPY\x01\x00" + len(body).to_bytes(2, "little") + body + stack.tobytes()
    (tmp_path / "b.npy").write_bytes(content)
    joined(tmp_path / "b.npy").fails("b.npy")


def test_an_archive_of_arrays_is_no_stack(joined, stack, tmp_path):
    np.savez(tmp_path / "b.npz", stack)
    shutil.move(tmp_path / "b.npz", tmp_path / "b.npy")
    joined(tmp_path / "b.npy").fails(
        "is a NumPy archive (.npz) of several arrays; save the one that is meant"
    )


def test_a_stack_that_shrinks_while_it_is_read(stack, tmp_path):
    from toposeam.errors import ImageError
    from toposeam_cli.media.stacks.reading import read_stack

    voxels = read_stack(tmp_path / "a.npy").voxels
    os.truncate(tmp_path / "a.npy", 200)
    with pytest.raises(ImageError, match="it is damaged or cut short"):
        voxels[3]


def test_damaged_tiffs_end_in_one_sentence(joined, stack, tmp_path):
    """Bytes at random places of a valid file, in its tables most of all."""
    path, rng = tmp_path / "b.tif", np.random.default_rng(1)
    for kind in ({"ome": True}, {"imagej": True}, {"compression": "zlib"}):
        tifffile.imwrite(path, stack[:4], metadata={"axes": "ZYX"}, photometric="minisblack", **kind)
        whole = path.read_bytes()
        for _ in range(25):
            damaged = bytearray(whole)
            for at in rng.integers(0, len(whole), 12):
                damaged[at] = rng.integers(256)
            for at in rng.integers(0, 400, 3):
                damaged[at] = rng.integers(256)
            path.write_bytes(damaged)
            ran = joined(path, "--force")
            if ran.code:
                ran.is_one_sentence()


def test_large_stacks_need_leave(joined, toposeam, stack, tmp_path):
    np.save(tmp_path / "b.npy", stack)
    joined(tmp_path / "b.npy", "--max-voxels", "12479").fails(
        "a.npy has 20×26×24 voxels, more than the 12479"
    )
    joined(tmp_path / "b.npy", "--max-voxels", "12480").fails(
        "joined, the stacks have 20×26×40 voxels, more than"
    )
    assert joined(tmp_path / "b.npy", "--max-voxels", "20800").code == 0
