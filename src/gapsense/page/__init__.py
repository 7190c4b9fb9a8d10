"""A scenario as a page: one HTML file in which it runs, by the C of the native FMUs and the runner's loop in WebAssembly."""
