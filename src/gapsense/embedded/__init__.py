"""Components as C99 for microcontrollers: source, header, an example that runs, and what a Cortex-M needs to start."""
