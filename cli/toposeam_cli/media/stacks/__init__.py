"""Stacks in and out: TIFF and OME-TIFF (tifffile), NumPy, zarr; their voxel sizes. No click in here."""
