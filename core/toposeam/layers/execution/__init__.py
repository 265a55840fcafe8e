"""Run independent tasks here, in processes or on a cluster, and report progress."""
