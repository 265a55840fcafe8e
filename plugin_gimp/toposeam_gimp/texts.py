"""GI-free: texts in the user's language, from ``locale/<language>/LC_MESSAGES/toposeam_gimp.mo``."""

from __future__ import annotations

import gettext
from pathlib import Path

_translation = gettext.translation("toposeam_gimp", Path(__file__).with_name("locale"), fallback=True)
_ = _translation.gettext
#: "en", or the language of the texts.
LANGUAGE = _translation.info().get("language", "en")
