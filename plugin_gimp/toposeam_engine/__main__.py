"""``python -m toposeam_engine FOLDER``: serve one request."""

import sys

from toposeam_engine.serving import main

sys.exit(main())
