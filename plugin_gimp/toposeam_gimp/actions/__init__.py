"""Actions of the menu entries: pixels to the engine, results into the image. Needs GIMP."""
