"""Files of pictures, clips and stacks."""
