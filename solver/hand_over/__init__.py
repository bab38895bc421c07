"""From settings to what is typed into a control system: its form, its units, its digits."""
