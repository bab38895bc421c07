"""The analyses, a module or package each; a new one needs nothing but its file here."""
