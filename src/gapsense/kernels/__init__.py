"""What kernels are written in, and what is made of them: code in Python and C, many runs at once."""
