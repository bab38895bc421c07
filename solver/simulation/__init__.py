"""Time responses with exact dead time: closed loops and relay experiments."""
