"""The index canvas: which pixel of the atlas shows where, rendered to a texture."""
