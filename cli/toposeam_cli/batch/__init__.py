"""Files of jobs and patterns of file names, turned into the words of other commands."""
