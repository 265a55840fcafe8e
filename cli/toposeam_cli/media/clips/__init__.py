"""Clips in and out: videos (PyAV), animated pictures (Pillow) and folders of frames. No click in here."""
