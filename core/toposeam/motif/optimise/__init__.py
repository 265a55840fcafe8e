"""Optimise layers of a motif: heat conduction, optimality criteria, compounds."""
