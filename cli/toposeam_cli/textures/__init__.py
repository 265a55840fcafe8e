"""Options and files that the texture commands share."""
