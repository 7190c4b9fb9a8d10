"""Files, locks, processes: what the operating system gives, made safe."""
