"""What menu entries do: pixels to the engine, results into the image. Needs GIMP."""
