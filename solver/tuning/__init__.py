"""The tuner: specification, objective, minimax method and search."""
