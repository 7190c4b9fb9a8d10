"""Reference models of actuators, and the physics they share."""
