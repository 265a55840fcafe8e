"""Options, pattern books and products that the motif commands share."""
