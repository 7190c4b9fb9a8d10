"""What kernels are written in, and what is made of them: code in three languages, many runs at once."""
