"""What every file that is written obeys: whole or not at all, also under Ctrl-C and ``kill``. No click in
here.
"""
