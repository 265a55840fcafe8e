"""One thin module a command: parse, read, one core call, write. The function has the module's name."""
