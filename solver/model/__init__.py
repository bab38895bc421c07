"""What the user describes, plants, controllers and weights, and its reduction to small blocks."""
