"""The page on which seams are edited: a session, a process that solves, a server, and the page itself."""
