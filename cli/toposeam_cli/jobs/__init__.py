"""Many jobs on worker processes or on Dask, with a table of results from which a run goes on. No click in
here.
"""
