"""The page on which seams are edited: a session, a process that solves, a server, and what the browser shows."""
