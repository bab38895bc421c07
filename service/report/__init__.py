"""The report of a tuning: one HTML file to print, sign and file."""
