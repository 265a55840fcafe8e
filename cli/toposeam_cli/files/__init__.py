"""Writing of files: whole or not at all, also under Ctrl-C and ``kill``. No click in here."""
