"""Volumes and clips: surfaces between overlapping ones, loops of clips, stacks joined."""
