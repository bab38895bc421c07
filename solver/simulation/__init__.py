"""Time responses with exact dead time: closed loops and what their engineers read off them."""
