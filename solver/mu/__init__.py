"""Upper and lower bounds of the structured singular value, and their certificates."""
