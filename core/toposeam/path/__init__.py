"""Ways for a robot, planned by heat on a plate."""
