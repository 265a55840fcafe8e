"""The command line of TopoSeam: files in, one core call, files out."""
