"""The order in which patches are laid, and the processes that lay them."""
