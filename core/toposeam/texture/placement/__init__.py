"""Choose and lay patches: distances, penalties, cuts."""
