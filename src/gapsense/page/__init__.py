"""A scenario as a page: one HTML file in which the C of the native FMUs and the runner's loop run, as WebAssembly."""
