"""Identification: from plant records to a plant, its uncertainty, and what is to be tested."""
