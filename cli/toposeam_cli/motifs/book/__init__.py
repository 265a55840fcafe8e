"""The pattern book: its patterns as jobs, its pages as HTML and PDF."""
