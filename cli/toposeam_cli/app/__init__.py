"""The command itself: its commands, options, progress and shells."""
