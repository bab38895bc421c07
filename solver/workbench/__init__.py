"""What scripts and notebooks use: tuning by keywords, results by unit, files, other libraries."""
