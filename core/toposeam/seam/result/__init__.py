"""The seam found: apply, draw, judge."""
