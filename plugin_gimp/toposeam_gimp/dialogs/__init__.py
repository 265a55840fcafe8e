"""Dialogs, their choices and previews."""
