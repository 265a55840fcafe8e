"""GI-free: texts in the user's language, from ``locale/<language>/LC_MESSAGES/toposeam_gimp.mo``."""

from __future__ import annotations

import gettext
from pathlib import Path

_ = gettext.translation("toposeam_gimp", Path(__file__).with_name("locale"), fallback=True).gettext
