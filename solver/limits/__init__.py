"""What any controller could do on a plant, and what lies between that and single loops."""
