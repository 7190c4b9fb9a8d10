"""FMI 2.0: port tables, the shell in the FMU, its model description, its packaging. No physics."""
