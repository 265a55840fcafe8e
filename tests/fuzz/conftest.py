"""The fuzzers are programs of their own, which the tests here start."""

collect_ignore = ["commands.py", "functions.py", "watched.py"]
