from .trial import is_seen, reduced_copies, trial_seam

__all__ = ["is_seen", "reduced_copies", "trial_seam"]
