"""Many jobs on worker processes or on Dask, with a table of results to go on from. No click in here."""
